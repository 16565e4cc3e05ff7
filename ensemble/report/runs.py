"""Runs of a report: taken from the store, or made one after the other and kept there."""

from __future__ import annotations

from ensemble.config.run_key import run_key
from ensemble.report.report_progress import Tell
from ensemble.store import Store
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Run
from solver.scene import Scene, Start
from solver.simulation.simulate import simulate

_WARM_UP = 50  # evaluations


class Runs:
    """Makes each run once, in this thread, so that nothing else of this process disturbs its timing.

    Parameters
    ----------
    store : Store
    tell : callable
        Takes a line about every run that is made.
    """

    def __init__(self, store: Store, tell: Tell) -> None:
        self._store = store
        self._tell = tell
        self._warm: set[tuple[object, ...]] = set()

    def summary(self, scene: Scene, label: str) -> RunSummary:
        """Everything about the run of a scene except its arrays."""
        return self._store.summary(self._key(scene, label))

    def run(self, scene: Scene, label: str) -> Run:
        """The whole run of a scene."""
        return self._store.load(self._key(scene, label))

    def _key(self, scene: Scene, label: str) -> str:
        key = run_key(scene)
        if not self._store.contains(key):
            self._warm_up(scene)
            self._tell(label)
            self._store.save(simulate(scene))
        return key

    def _warm_up(self, scene: Scene) -> None:
        """Compile and fill caches, once for all scenes of a kind, or the first run's time would hold it."""
        flow = type(scene.flow)
        exponents = None if scene.adhesion is None else scene.adhesion.exponents
        numerics = scene.numerics
        kind = (len(scene.vesicles), flow, exponents, numerics.points, numerics.integrator)
        if kind not in self._warm:
            brief = numerics.model_copy(update={"work_limit": _WARM_UP})
            simulate(scene.model_copy(update={"numerics": brief, "start": Start()}))
            self._warm.add(kind)
