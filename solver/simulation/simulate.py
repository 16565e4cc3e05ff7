"""From a scene to a finished run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from solver.analysis.record import Forgetful, InMemory
from solver.analysis.run import HOPELESS_SPATIAL, LARGEST_SPATIAL, Outcome, RunResults
from solver.forces.tension import TensionNotFoundError
from solver.integrators import StepFailedError
from solver.membrane.geometry import Membranes
from solver.motion.terms import accurate_equation
from solver.parallel import SERIAL, Parallel, first_rank_asks
from solver.simulation.blas_threads import one_blas_thread
from solver.simulation.initial_state import placed_state, rotated_state
from solver.simulation.moving_frame import MovingFrame
from solver.simulation.resolution import UnresolvedError, resolution_of, with_points
from solver.simulation.run_results import results_of
from solver.simulation.time_loop import TimeLoop
from solver.steady_states.rest import HiddenInstabilityError, rest_near
from solver.steady_states.steady_equations import SteadyEquations

if TYPE_CHECKING:
    from solver.analysis.record import Sink
    from solver.analysis.run import Run
    from solver.memory import Saved
    from solver.scene import Scene
    from solver.steady_states.rest import Rest

Array = NDArray[np.float64]

# While a start relaxes, whatever the scene records: only its last state is kept.
_RELAXATION_OUTPUT = {"interval": 2.0, "frame_interval": 10.0}

_NUMERICAL_FAILURES = (
    StepFailedError,
    UnresolvedError,
    TensionNotFoundError,
    HiddenInstabilityError,
    np.linalg.LinAlgError,
)


def simulate(
    scene: Scene,
    *,
    parallel: Parallel = SERIAL,
    after_step: Callable[[Simulation], None] | None = None,
) -> Run:
    """Run a scene until its outcome is decided.

    Collective: all ranks of ``parallel`` call it with the same scene and return the same run.

    Parameters
    ----------
    scene : Scene
    parallel : Parallel
        The ranks that compute the run together.
    after_step : callable, optional
        See `Simulation.complete`.

    Returns
    -------
    Run
        A numerical failure is an outcome (`Outcome.FAILED` with its reason), not an exception.
    """
    with one_blas_thread():
        return Simulation(scene, parallel=parallel).complete(after_step)


class Simulation:
    """A scene that is run step by step, and may be saved in between.

    A simulation that is restored goes on to the same bits as one that was never interrupted, on as many
    ranks; on another number to round-off.

    Collective: all ranks of ``parallel`` make it with the same scene and call the same methods.

    Parameters
    ----------
    scene : Scene
    parallel : Parallel
        The ranks that compute the run together.
    sink : Sink, optional
        That takes what is recorded, on this rank.  Left out, the simulation keeps it.
    """

    def __init__(self, scene: Scene, *, parallel: Parallel = SERIAL, sink: Sink | None = None) -> None:
        self._relaxation: Simulation | None = None
        self._prepare(scene, parallel, sink, 0.0)
        with one_blas_thread():
            points = self._resolution.points
            if self._within.start.relaxed:
                self._relaxation = Simulation(_at_rest(self._within), parallel=parallel, sink=Forgetful())
            else:
                self._begin(_Start(points, placed_state(with_points(self._within, points))))

    def _prepare(self, scene: Scene, parallel: Parallel, sink: Sink | None, elapsed: float) -> None:
        """Set what the scene alone decides, and the wall time that is used up."""
        self._scene, self._parallel = scene, parallel
        self._sink = InMemory() if sink is None else sink
        self._began = clock.perf_counter() - elapsed
        self._frame = MovingFrame.of_scene(scene)
        self._within = self._frame.scene if self._frame else scene
        self._resolution = resolution_of(self._within)
        self._limit = _wall_limit(scene, parallel, self._began)
        self._loop: TimeLoop | None = None
        self._start_points = self._resolution.points
        self._start_evaluations = 0
        self._failure: str | None = None

    @property
    def time(self) -> float:
        """The time reached; 0 while the start relaxes."""
        return self._loop.time if self._loop else 0.0

    @property
    def relaxes(self) -> bool:
        """Whether steps still lead to the relaxed start."""
        return self._loop is None

    @property
    def done(self) -> bool:
        """Whether the outcome is decided."""
        return self._failure is not None or (self._loop is not None and self._loop.done)

    def step(self) -> None:
        """Take one step, of the relaxation of the start as long as that lasts.

        A step may be rejected: then the next one is taken with more points.  A numerical failure ends the
        run.

        Raises
        ------
        ValueError
            If the run is done.
        """
        if self.done:
            raise ValueError("the run is done: no step is left")
        with one_blas_thread():
            if self._loop is None:
                self._relax()
                return
            try:
                if self._loop.advance():
                    self._limit(self._loop.time)
                if self._loop.done:
                    self._loop.recorder.finish(self._loop.time, self._loop.state)
            except _NUMERICAL_FAILURES as error:
                self._failure = _failure(self._loop, error)
            if self.done:
                self._loop.recorder.hand_over()

    def complete(self, after_step: Callable[[Simulation], None] | None = None) -> Run:
        """Take all steps that are left, and return the run.

        Parameters
        ----------
        after_step : callable, optional
            See `finish`.

        Returns
        -------
        Run
        """
        return self._recorded(self.finish(after_step))

    def finish(self, after_step: Callable[[Simulation], None] | None = None) -> RunResults:
        """Take all steps that are left, and return what the run came to.

        Parameters
        ----------
        after_step : callable, optional
            Called on each rank after every step, the last one included, with this simulation.  It may read,
            and save; what it raises ends the loop and has to be raised on all ranks.

        Returns
        -------
        RunResults
        """
        with one_blas_thread():
            while not self.done:
                self.step()
                if after_step:
                    after_step(self)
            return self.results()

    def results(self) -> RunResults:
        """Return what the run came to.

        Returns
        -------
        RunResults

        Raises
        ------
        ValueError
            If it is not done.
        """
        if self._loop is None or not self.done:
            raise ValueError(f"the run is at time {self.time:g} and not done: take further steps")
        with one_blas_thread():
            return results_of(self._scene, self._loop, self._failure, self._start_evaluations, self._elapsed)

    def run(self) -> Run:
        """Return the run.

        Returns
        -------
        Run

        Raises
        ------
        ValueError
            If it is not done, or another sink has what it recorded.
        """
        return self._recorded(self.results())

    def saved(self) -> Saved:
        """Return everything that decides the steps to come.

        Returns
        -------
        dict
            Numbers, strings, None, arrays, and tuples, lists and dictionaries of such.

        Raises
        ------
        ValueError
            If the run is done.
        """
        if self.done:
            raise ValueError("the run is done: take its result")
        with one_blas_thread():
            return {
                "wall_seconds": self._elapsed,
                "relaxation": self._relaxation.saved() if self._relaxation else None,
                "start_points": self._start_points,
                "start_evaluations": self._start_evaluations,
                "loop": self._loop.saved() if self._loop else None,
                "sink": self._sink.saved(),
            }

    @classmethod
    def restored(
        cls, scene: Scene, saved: Saved, *, parallel: Parallel = SERIAL, sink: Sink | None = None
    ) -> Self:
        """Go on with a simulation that was saved.

        Parameters
        ----------
        scene : Scene
            The same.
        saved : dict
            As `saved` returned it.
        parallel : Parallel
            The ranks that go on together.
        sink : Sink, optional
            Of the kind that it had on the rank that saved it.

        Returns
        -------
        Simulation
        """
        simulation = cls.__new__(cls)
        simulation._relaxation = None
        with one_blas_thread():
            simulation._prepare(scene, parallel, sink, saved["wall_seconds"])
            if saved["relaxation"]:
                relaxing = _at_rest(simulation._within)
                simulation._relaxation = cls.restored(
                    relaxing, saved["relaxation"], parallel=parallel, sink=Forgetful()
                )
                simulation._sink.restore(saved["sink"])
                return simulation
            simulation._start_points = saved["start_points"]
            simulation._start_evaluations = saved["start_evaluations"]
            placed = with_points(simulation._within, simulation._start_points)
            simulation._loop = simulation._time_loop(placed, placed_state(placed))
            simulation._loop.restore(saved["loop"])
            simulation._sink.restore(saved["sink"])  # last: one that fails leaves it as it is
        return simulation

    def _recorded(self, results: RunResults) -> Run:
        """Put the results and what was recorded together."""
        if not isinstance(self._sink, InMemory):
            raise ValueError("what the run recorded is in the sink that the simulation was given")
        return self._sink.run(results)

    @property
    def _elapsed(self) -> float:
        return clock.perf_counter() - self._began

    def _relax(self) -> None:
        """Take a step of the relaxation; after the last one begin the run."""
        assert self._relaxation
        if not self._relaxation.done:
            self._relaxation.step()
        if self._relaxation.done:
            assert self._relaxation._loop
            start = _relaxed_start(
                self._within,
                self._resolution.points,
                self._relaxation.results(),
                self._relaxation._loop.recorder.frame,
            )
            self._relaxation = None
            self._begin(start)

    def _begin(self, start: _Start) -> None:
        """Record the start, and prepare the first step unless there is none."""
        self._start_points, self._start_evaluations = start.points, start.evaluations
        self._loop = loop = self._time_loop(with_points(self._within, start.points), start.state)
        try:
            loop.recorder.record(loop.time, loop.state)
            if start.failure:
                raise StepFailedError(start.failure)
            if loop.recorder.spatial_error > HOPELESS_SPATIAL:
                raise UnresolvedError("the run was not begun")
            loop.begin()
        except _NUMERICAL_FAILURES as error:
            self._failure = _failure(loop, error)
        if self.done:
            loop.recorder.hand_over()

    def _time_loop(self, placed: Scene, state: Array) -> TimeLoop:
        """Return the loop from a state on."""
        scene = self._scene
        # A circle has no other shape near: there is nothing to examine.
        has_circle = any(vesicle.is_circle for vesicle in scene.vesicles)
        examine = None if scene.many or has_circle else partial(_examined, self._within.settled)
        return TimeLoop(placed, state, self._resolution, self._parallel, self._sink, self._frame, examine)


@dataclass(frozen=True)
class _Start:
    """The state to begin with, its number of points, what finding it cost, and why it could not be found."""

    points: int
    state: Array
    evaluations: int = 0
    failure: str | None = None


def _wall_limit(scene: Scene, parallel: Parallel, began: float) -> Callable[[float], None]:
    """Return what fails once the scene's wall limit is reached; it is given the time in the run."""
    limit = scene.numerics.wall_limit
    if limit is None:
        return lambda time: None
    reached = first_rank_asks(parallel, lambda: clock.perf_counter() - began > limit)

    def require_time(time: float) -> None:
        if reached and reached():
            raise StepFailedError(f"the wall limit of {limit:g} s is reached at time {time:g}")

    return require_time


def _at_rest(scene: Scene) -> Scene:
    """Return the scene that relaxes to the start of a scene."""
    return scene.model_copy(
        update={
            "flow": None,
            "protocol": None,
            "start": scene.start.model_copy(update={"relaxed": False}),
            "horizon": scene.start.horizon,
            "output": scene.output.model_copy(update=_RELAXATION_OUTPUT),
        }
    )


def _relaxed_start(
    scene: Scene, points: int, relaxed: RunResults, frame: Mapping[str, float | Array]
) -> _Start:
    """Return where a run begins that needs this number of points for the vesicles as they are placed.

    The frame is the last one of the relaxation.
    """
    evaluations = relaxed.work.rhs_evaluations
    if relaxed.outcome is not Outcome.EQUILIBRIUM:
        reason = relaxed.failure or f"{relaxed.outcome} at time {relaxed.time:g}"
        placed = placed_state(with_points(scene, points))
        return _Start(points, placed, evaluations, f"start: the pair did not relax ({reason})")
    tangent_angle, center = np.asarray(frame["tangent_angle"]), np.asarray(frame["center"])
    points = tangent_angle.shape[-1]
    membranes = Membranes.of_scene(with_points(scene, points))
    computed = slice(membranes.count)  # the others are images
    last = membranes.pack(tangent_angle[computed], center[computed])
    return _Start(points, rotated_state(membranes, last, scene.start.tilt), evaluations)


def _examined(scene: Scene, membranes: Membranes, state: Array) -> Rest:
    """Find out what is behind a state that hardly changes; each rank does, with the same bits."""
    placed = with_points(scene, membranes.points)
    equations = SteadyEquations(accurate_equation(scene.vesicles, placed), placed)
    return rest_near(equations, membranes, state)


def _failure(loop: TimeLoop, error: Exception) -> str:
    """Return why a run failed, and see to it that at least its start is recorded."""
    recorder = loop.recorder
    if not recorder.sample:
        recorder.record_geometry(loop.time, loop.state)
    points, spatial = loop.segment.membranes.points, recorder.spatial_error
    if spatial > LARGEST_SPATIAL:
        return f"{error} ({points} points do not resolve the scene: spatial error {spatial:.1e})"
    return str(error)
