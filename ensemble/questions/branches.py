"""The questions which steady state a scene has, and how it changes with a parameter.

They start from the end of the scene's run, which a store may have already.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ensemble.config.dotted_paths import parameter_value
from ensemble.config.measured import Measured, measured_document, measured_fields, measured_values
from ensemble.config.overrides import override
from ensemble.config.run_key import run_key
from ensemble.config.validation import validated
from ensemble.errors import SUSPENDED_STATUS, Interrupted
from ensemble.questions.question import Answer, StoredAnswer, StoredAnswers
from solver.dimensions import RATE, TIME
from solver.scene import LARGEST_DENSE, Scene, Units

if TYPE_CHECKING:
    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.search.branch_summary import BranchSummary
    from ensemble.store import Store
    from ensemble.store.listing import Listing
    from solver.analysis.run import Run
    from solver.simulation.vesicle_shapes import Shapes


@dataclass(frozen=True)
class BranchQuestion:
    """How the steady states of a scene change with a parameter.

    Attributes
    ----------
    scene : Scene
        At the start of the branch.
    parameter : str
        Dotted path of a number in the scene.
    to : float or None
        Value at which the branch ends; None to follow it upward as far as it goes.
    """

    scene: Scene
    parameter: str
    to: float | None

    def __post_init__(self) -> None:
        require_steady_states(self.scene)
        if self.to == self.start:
            raise ValueError(f"to: {self.to:g} is the value that the scene has; give another one")
        if self.to is not None:
            self.scene_at(self.to)

    @property
    def start(self) -> float:
        """Value of the parameter in the scene."""
        return float(parameter_value(self.scene, self.parameter))

    def scene_at(self, value: float) -> Scene:
        """Return the scene at a value of the parameter.

        Parameters
        ----------
        value : float

        Returns
        -------
        Scene

        Raises
        ------
        OutsideParameterError
            If the scene does not allow it.
        """
        from solver.steady_states.continuation import OutsideParameterError

        try:
            return validated(Scene, override(self.scene.model_dump(), {self.parameter: value}))
        except ValueError as error:
            raise OutsideParameterError(str(error)) from error

    def answer(self, path: Path | None) -> Answer:
        """Follow the branch, unless a store has it.

        Parameters
        ----------
        path : Path or None
            Directory of the store that keeps the branch and the run from which it starts.

        Returns
        -------
        Answer
        """
        from ensemble.search.branch_summary import branch_key
        from ensemble.store.branch_record import summary_of
        from solver.simulation.resolution import with_points
        from solver.simulation.steady_scenes import follow_steady_states
        from solver.steady_states.continuation import Limits
        from solver.steady_states.newton import NoSteadyStateError

        began = clock.perf_counter()
        with opened(path) as store:
            key = branch_key(self.scene, self.parameter, self.to)
            if store is not None and store.branches.contains(key):
                summary = store.branches.read(key).in_units(self.scene.units)
                return _FollowedBranch(summary, clock.perf_counter() - began)
            near = _end_of_run(self.scene, store)
            if isinstance(near, str):
                return NoAnswer(near)
            points = near.tangent_angle.shape[1]
            limits = Limits(float("inf") if self.to is None else self.to)
            upward = limits.to > self.start
            try:
                branch = follow_steady_states(
                    lambda value: with_points(self.scene_at(value), points), self.start, near, limits, upward
                )
            except NoSteadyStateError as error:
                return NoAnswer(str(error))
            summary = summary_of(self.scene, self.parameter, self.to, branch)
            if store is not None:
                store.save_branch(summary, branch)
            return _FollowedBranch(summary, clock.perf_counter() - began)


def steady_answer(scene: Scene, path: Path | None) -> Answer:
    """Find the steady state to which the run of a scene comes.

    Parameters
    ----------
    scene : Scene
    path : Path or None
        Directory of the store that keeps the run.

    Returns
    -------
    Answer

    Raises
    ------
    ValueError
        If steady states of such a scene are not computed.
    """
    from ensemble.search.branch_summary import SteadyRecord
    from solver.simulation.resolution import with_points
    from solver.simulation.steady_scenes import find_steady_state
    from solver.steady_states.newton import NoSteadyStateError

    require_steady_states(scene)
    with opened(path) as store:
        near = _end_of_run(scene, store)
    if isinstance(near, str):
        return NoAnswer(near)
    try:
        state = find_steady_state(with_points(scene, near.tangent_angle.shape[1]), near)
    except NoSteadyStateError as error:
        return NoAnswer(str(error))
    record = SteadyRecord.of(state)
    document = record.model_dump(mode="json")
    return _SteadyAnswer(document, run_key(scene), measured_fields(record, document, scene.units))


def settled_answer(scene: Scene, path: Path | None) -> Answer:
    """Find out whether the motion to which a revolving pair settles is stable against broken symmetry.

    Parameters
    ----------
    scene : Scene
    path : Path or None
        Directory of the store that keeps the run.

    Returns
    -------
    Answer

    Raises
    ------
    ValueError
        If the pair has no symmetry that could be broken, or a rate that changes with time.
    """
    from solver.simulation.broken_symmetry import require_image, symmetry_breaking

    _require_one_rate(scene)
    require_image(scene)
    with opened(path) as store:
        run = run_of(scene, store)
    if run.failure or run.period is None or not run.settled:
        return NoAnswer(f"the motion has not settled: {run.failure or run.undecided or run.outcome}")
    try:
        breaking = symmetry_breaking(run)
    except ArithmeticError as error:
        return NoAnswer(str(error))
    record = {"outcome": run.outcome, "period": run.period} | breaking.record()
    values = {"period": (record["period"], TIME), "growth_rate": (record["growth_rate"], RATE)}
    measured = measured_values(values, scene.units)
    return _SteadyAnswer(record, run_key(scene), measured)


def revolves(scene: Scene) -> bool:
    """Return whether the flow always turns several vesicles round, so that they have no steady state.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    bool
    """
    flow = scene.flow
    return len(scene.vesicles) > 1 and flow is not None and flow.rotates and not flow.strains


def _require_one_rate(scene: Scene) -> None:
    if scene.protocol is not None:
        raise ValueError("protocol: states and their stability are those at one rate; leave it out")


def require_steady_states(scene: Scene) -> None:
    """Refuse a scene whose steady states are not computed.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    ValueError
        If it has too many vesicles, a pair that revolves, or a rate that changes with time.
    """
    _require_one_rate(scene)
    count = len(scene.vesicles)
    if count > LARGEST_DENSE:
        raise ValueError(f"vesicles: steady states are computed of at most {LARGEST_DENSE}, got {count}")
    if scene.flow is not None and revolves(scene):
        raise ValueError(
            f"flow.kind: {scene.flow.kind!r} turns several vesicles round; they have no steady state"
        )


def opened(path: Path | None) -> Any:
    """Open a store, if there is to be one.

    Parameters
    ----------
    path : Path or None
        Its directory.

    Returns
    -------
    context manager
        Gives the store, or None.
    """
    from ensemble.store import Store

    return nullcontext() if path is None else Store.open(path)


def run_of(scene: Scene, store: Store | None) -> Run:
    """Return the run of a scene, from a store if it has it.

    Parameters
    ----------
    scene : Scene
    store : Store or None

    Returns
    -------
    Run
    """
    if store is None:
        from solver.simulation.simulate import simulate

        return simulate(scene)

    from ensemble.mpi.end_requests import EndRequests
    from ensemble.mpi.single_run import single_run

    single_run(None, scene, store, 1, lambda *_: None)
    if EndRequests.accepted():  # the run was done with its last step, and what follows cannot be stopped
        raise Interrupted(SUSPENDED_STATUS)
    return store.load(run_key(scene))


def _end_of_run(scene: Scene, store: Store | None) -> Shapes | str:
    """Return the shapes at the end of the scene's run, or why it comes to no rest."""
    from solver.analysis.run import Outcome
    from solver.simulation.vesicle_shapes import Shapes

    run = run_of(scene, store)
    if run.outcome in (Outcome.FAILED, Outcome.SEPARATED, Outcome.TUMBLING):
        return f"the run of the scene comes to no rest: {run.failure or run.outcome}"
    center = run.frames.center[-1]
    if scene.flow is not None and scene.flow.comoving is not None:
        center = center - center.mean(axis=0)  # the flow has carried them away, and far off digits are lost
    return Shapes(run.frames.tangent_angle[-1], center)


@dataclass(frozen=True)
class NoAnswer(Answer):
    """There is no steady state, for a reason.

    Attributes
    ----------
    failure : str
        The reason.
    """

    failure: str
    complete: ClassVar[bool] = False

    def json_document(self) -> dict[str, Any]:
        """Return the reason."""
        return {"failure": self.failure}

    def table(self) -> Table:
        """Return the reason."""
        from ensemble.display.result_tables import fields_table

        return fields_table(self.json_document())


@dataclass(frozen=True)
class _SteadyAnswer(Answer):
    """A steady state."""

    record: dict[str, Any]
    key: str
    measured: Mapping[str, Measured]
    complete: ClassVar[bool] = True

    def json_document(self) -> dict[str, Any]:
        return self._document() | measured_document(self.measured)

    def table(self) -> Table:
        from ensemble.display.result_tables import fields_table

        return fields_table(self._document(), self.measured)

    def _document(self) -> dict[str, Any]:
        return {"failure": None} | self.record | {"run_key": self.key}


@dataclass(frozen=True)
class _FollowedBranch(Answer):
    """A branch that has just been followed, or that the store had already."""

    summary: BranchSummary
    seconds: float
    complete: ClassVar[bool] = True

    def json_document(self) -> dict[str, Any]:
        return {"failure": None} | self.summary.document() | {"wall_seconds": self.seconds}

    def table(self) -> Table:
        from ensemble.display.branch_tables import branch_table

        return branch_table(self.summary)

    @property
    def footer(self) -> str:
        return f"it was followed no farther: {self.summary.ended}"


@dataclass(frozen=True)
class _StoredBranch(StoredAnswer):
    """A branch of a store."""

    summary: BranchSummary

    def in_units(self, units: Units) -> StoredAnswer:
        return _StoredBranch(self.summary.in_units(units))

    def json_document(self) -> dict[str, Any]:
        return self.summary.document()

    def table(self) -> Table:
        from ensemble.display.branch_tables import branch_table

        return branch_table(self.summary)

    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw the bifurcation diagram."""
        from ensemble.figures import save
        from ensemble.figures.bifurcation import bifurcation_diagram

        save(bifurcation_diagram([self.summary]), output, options)


class StoredBranches:
    """The branches of stores, as `ensemble query` and `ensemble show` ask for them."""

    collection: ClassVar[str] = "branches"

    @classmethod
    def stored(cls, store: Store, name: str) -> StoredAnswer | None:
        """Return a branch.

        Parameters
        ----------
        store : Store
        name : str
            Its key, or as much of it as no other key begins with.

        Returns
        -------
        StoredAnswer or None
            None if there is no such branch.
        """
        keys = [key for key in store.branches.keys() if name and key.startswith(name)]  # noqa: SIM118
        return _StoredBranch(store.branches.read(keys[0])) if len(keys) == 1 else None

    @classmethod
    def all_stored(cls, store: Store, listing: Listing, columns: Sequence[str]) -> StoredAnswers:
        """Return the branches of a store.

        Parameters
        ----------
        store : Store
        listing : Listing
            Fields are those of the scene at the first point and of the branch, such as ``parameter`` or
            ``folds.0.value``.
        columns : sequence of str
            Such fields; if empty, the usual ones.

        Returns
        -------
        StoredAnswers
        """
        from ensemble.store.branch_listing import BRANCH_FIELDS, listed
        from ensemble.store.columns import ListColumn, columns_of

        shown = columns_of(columns, BRANCH_FIELDS) or (
            ListColumn("branch", itemgetter("key")),
            ListColumn("parameter", itemgetter("parameter")),
            ListColumn("from", lambda branch: branch["branch"][0]["parameter"]),
            ListColumn("points", lambda branch: len(branch["branch"])),
            ListColumn("folds", lambda branch: [point["value"] for point in branch["folds"]] or None),
            ListColumn("crossings", lambda branch: [point["value"] for point in branch["crossings"]] or None),
        )
        return StoredAnswers(iter(listed(store.branches.summaries(), listing)), shown)
