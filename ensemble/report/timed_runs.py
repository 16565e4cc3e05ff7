"""Runs of a report that measures time: taken from the store, or made one after the other and kept there."""

from __future__ import annotations

from collections.abc import Callable

from ensemble.config.run_key import run_key
from ensemble.store import Store
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Run
from solver.scene import Scene, Start
from solver.simulation.simulate import simulate

_WARM_UP = 50  # evaluations


class TimedRuns:
    """Makes each run once, in this thread, so that nothing else in this process disturbs its time.

    Parameters
    ----------
    store : Store
        The store that keeps the runs.
    log : callable
        Called with one line of text before each run that is made.
    """

    def __init__(self, store: Store, log: Callable[[str], None]) -> None:
        self._store = store
        self._log = log
        self._warm: set[tuple[object, ...]] = set()

    def summary(self, scene: Scene, label: str) -> RunSummary:
        """Return everything about the run of a scene except its arrays; make the run if necessary.

        Parameters
        ----------
        scene : Scene
            What to simulate.
        label : str
            What to log if the run has to be made.

        Returns
        -------
        RunSummary
            Summary of the stored run.
        """
        return self._store.summary(self._key(scene, label))

    def run(self, scene: Scene, label: str) -> Run:
        """Return the run of a scene; make it if necessary.

        Parameters
        ----------
        scene : Scene
            What to simulate.
        label : str
            What to log if the run has to be made.

        Returns
        -------
        Run
            The stored run.
        """
        return self._store.load(self._key(scene, label))

    def _key(self, scene: Scene, label: str) -> str:
        key = run_key(scene)
        if not self._store.contains(key):
            self._warm_up(scene)
            self._log(label)
            self._store.save(simulate(scene))
        return key

    def _warm_up(self, scene: Scene) -> None:
        """Compile and fill caches once for each kind of scene; else the first run would include that time."""
        flow = type(scene.flow)
        formula = None if scene.adhesion is None else scene.adhesion.formula
        numerics = scene.numerics
        kind = (len(scene.vesicles), flow, formula, numerics.points, numerics.integrator)
        if kind not in self._warm:
            brief = numerics.model_copy(update={"work_limit": _WARM_UP})
            simulate(scene.model_copy(update={"numerics": brief, "start": Start()}))
            self._warm.add(kind)
