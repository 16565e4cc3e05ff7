"""The time loop: one step after the other, until the outcome is decided."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.answer_errors import AnswerErrors
from solver.analysis.criteria import History, criteria_for
from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.long_axis import LongAxisTracker, may_tumble
from solver.analysis.recorder import Recorder
from solver.analysis.revolutions import RevolutionTracker, counted_direction
from solver.analysis.run import Outcome
from solver.analysis.viscosity_history import ViscosityHistory
from solver.integrators import Step, StepFailedError
from solver.membrane.resampling import resampled_state
from solver.memory import Remembering, Saved
from solver.motion.terms import equation_of_motion
from solver.motion.timed import with_clock
from solver.parallel import require_agreement
from solver.simulation.resolution import Resolution, with_points
from solver.simulation.segment import Segment, SegmentWork

if TYPE_CHECKING:
    from solver.analysis.record import Sink
    from solver.membrane.geometry import Membranes
    from solver.parallel import Parallel
    from solver.scene import Scene
    from solver.simulation.moving_frame import MovingFrame
    from solver.steady_states.rest import Rest

Array = NDArray[np.float64]


class TimeLoop(Remembering):
    """Advances a scene step by step.

    Parameters
    ----------
    scene : Scene
        With the number of points at the start.
    state : (state_size,)
        At time 0, with these points.
    resolution : Resolution
        Asks for more points.
    parallel : Parallel
        The ranks that compute the run together.
    sink : Sink
        That takes what is recorded.
    frame : MovingFrame or None
        In which the scene is given; None for one that is at rest.
    examine : callable or None
        From membranes and a state that hardly changes to what is behind it (`History`).

    Attributes
    ----------
    time : float
    state : (state_size,)
        At this time; with a clock if the scene has a protocol (`solver.motion.timed`).
    outcome : Outcome
        `UNDECIDED` as long as the run goes on.
    segment : Segment
        The part of the run that has the present number of points, up to the next break of the protocol.
    tracker : RevolutionTracker or None
        Of the line of centers of a pair, or of the long axis of a single vesicle that may tumble.
    recorder : Recorder
    viscosities : ViscosityHistory or None
        In shear.
    steps, rejected_steps : int
    smallest_step : float or None
        Of the accepted steps; None before the first one.
    temporal_error : float
        Sum of the estimated local errors.
    perturbations : list of float
        Times at which the run rested in an unstable state and was perturbed.
    error : (state_size, 2) or None
        Estimated error of the state, see `Step`; None before the first step, and if the integrator does not
        propagate it.
    answer_errors : AnswerErrors
    """

    memory = (
        "time",
        "state",
        "error",
        "steps",
        "rejected_steps",
        "smallest_step",
        "temporal_error",
        "perturbations",
        "_line_of_centers",
        "_long_axis",
        "viscosities",
        "recorder",
        "answer_errors",
        "_frame",
    )

    def __init__(
        self,
        scene: Scene,
        state: Array,
        resolution: Resolution,
        parallel: Parallel,
        sink: Sink,
        frame: MovingFrame | None = None,
        examine: Callable[[Membranes, Array], Rest] | None = None,
    ) -> None:
        self._scene = scene
        self._resolution = resolution
        self._parallel = parallel
        self._frame = frame
        self._examine = examine
        self._criteria = criteria_for(scene)
        self.time = 0.0
        self.state = self._clocked(state)
        self.outcome = Outcome.UNDECIDED
        self.segment = Segment(equation_of_motion(scene, parallel, self.time), scene, SegmentWork())
        membranes = self.segment.membranes
        counted = counted_direction(scene.flow)
        self._line_of_centers = (
            LineOfCenters(membranes, state, counted, scene.criteria.separated_distance)
            if len(scene.vesicles) == 2
            else None
        )
        self._long_axis = LongAxisTracker(membranes, state, counted) if may_tumble(scene) else None
        self.tracker: RevolutionTracker | None = self._line_of_centers or self._long_axis
        self.recorder = Recorder(
            scene, self.segment.equation, self._line_of_centers, sink, frame.origin if frame else None
        )
        self.viscosities = ViscosityHistory(scene, self.segment.equation) if scene.shear_rate else None
        if self.viscosities and not self.tracker:
            self.viscosities.mark(scene.horizon / 2)
        self.steps = self.rejected_steps = 0
        self.smallest_step: float | None = None
        self.temporal_error = 0.0
        self.perturbations: list[float] = []
        self.error: Array | None = None
        self.answer_errors = AnswerErrors(self.tracker)

    def saved(self) -> Saved:
        """Return everything that decides what follows; `begin` comes before.  Collective.

        Returns
        -------
        dict
            See `solver.memory`.
        """
        return {
            **super().saved(),
            "outcome": str(self.outcome),
            "criteria": [criterion.saved() for criterion in self._criteria],
            "segment": self.segment.saved(),
        }

    def restore(self, saved: Saved) -> None:
        """Go on where another loop over the same scene was.  Collective.

        Parameters
        ----------
        saved : dict
        """
        begun, *_ = saved["segment"]["begun"]
        self._take_segment(saved["segment"]["points"], begun)
        super().restore(saved)
        self.outcome = Outcome(saved["outcome"])
        for criterion, its_memory in zip(self._criteria, saved["criteria"], strict=True):
            criterion.restore(its_memory)
        self.segment = Segment.restored(saved["segment"], self.segment.equation, self._scene)

    @property
    def done(self) -> bool:
        """Whether the run is decided or has come to its latest time."""
        return self.time >= self._scene.horizon or self.outcome is not Outcome.UNDECIDED

    @property
    def settled(self) -> bool:
        """Whether the motion that is tracked has settled."""
        return self.tracker is not None and self.tracker.has_settled(self._scene.criteria.settled_change)

    def begin(self) -> None:
        """Prepare the first step."""
        for criterion in self._criteria:
            criterion.begin(self._history)
        self.segment.begin(self.time, self.state, self._latest, self.error)

    def advance(self) -> bool:
        """Take one step.

        Returns
        -------
        bool
            Whether the step was accepted; if not, the next one is taken with more points.

        Raises
        ------
        StepFailedError
            If no step is possible, or the work limit of the scene is reached.
        UnresolvedError
            If no number of points resolves the state.
        TensionNotFoundError
            If the membranes are too distorted.
        """
        latest = self._latest
        step = self.segment.step()
        require_agreement(self._parallel, step.end)
        points = self._resolution.finer(self.segment.membranes, step.end, step.state)
        if points is not None:
            self._refine(points)
            return False
        self._accept(step)
        if self.time >= latest and not self.done:
            self._pass_break()
        limit = self._scene.numerics.work_limit
        if self.segment.work.evaluations > limit:
            raise StepFailedError(f"the work limit of {limit} evaluations is reached")
        return True

    @property
    def _latest(self) -> float:
        """When the present steps end at the latest: no step goes on where the rate, or its slope, jumps."""
        protocol, horizon = self._scene.protocol, self._scene.horizon
        return min(protocol.next_break(self.time), horizon) if protocol else horizon

    def _clocked(self, state: Array) -> Array:
        """Return a state with its time, if the motion depends on it."""
        return with_clock(state, self.time) if self._scene.protocol else state

    def _pass_break(self) -> None:
        """Go on with another rate.  A motion can settle under one rate only."""
        if self.tracker:
            self.tracker.count_from_here()
            self.answer_errors.count_from_here()
        membranes = self.segment.membranes
        self.state = self._clocked(self.state[: membranes.state_size])  # without the clock's round-off
        self._take_segment(membranes.points, self.time)
        self.begin()

    def _refine(self, points: int) -> None:
        """Go on from the start of the step with more points."""
        coarse = self.segment.membranes
        self._take_segment(points, self.time)
        state = resampled_state(coarse, self.state, self.segment.membranes)
        if self.error is not None:
            columns = [
                state - resampled_state(coarse, self.state - column, self.segment.membranes)
                for column in self.error.T
            ]
            self.error = np.stack(columns, axis=1)
        self.state = state
        self.rejected_steps += 1
        self.begin()

    def _depart(self) -> None:
        """Go on from the state that a criterion wants, if one does."""
        for criterion in self._criteria:
            if criterion.departure is not None:
                self.state, criterion.departure = self._clocked(criterion.departure), None
                self.perturbations.append(float(self.time))
                self._take_segment(self.segment.membranes.points, self.time)
                self.begin()

    def _take_segment(self, points: int, time: float) -> None:
        """Begin the part of the run that has this number of points and begins at a time."""
        equation = equation_of_motion(with_points(self._scene, points), self._parallel, time)
        self.segment = Segment(equation, self._scene, self.segment.work)
        self.recorder.continue_with(self.segment.equation)
        if self.viscosities:
            self.viscosities.continue_with(self.segment.equation)
        if self.tracker:
            self.tracker.membranes = self.segment.membranes

    def _accept(self, step: Step) -> None:
        # The last step is as long as what is left of the run, or up to a break.
        if step.end < self._latest or self.smallest_step is None:
            duration = float(step.end - step.start)
            self.smallest_step = min(self.smallest_step or duration, duration)
        if self.tracker:
            step = self.tracker.advance(step)
            self.answer_errors.follow(step)
        if self._frame:
            self._frame.follow(step, self.segment.membranes)
        self.recorder.record_up_to(step)
        if self.viscosities and self._enters_averages(step):
            for time in self.tracker.latest if self.tracker else ():
                self.viscosities.mark(time)
            self.viscosities.follow(step)
        self.time, self.state = step.end, step.state
        self.error = step.error(step.end) if step.error else None
        self.steps += 1
        self.rejected_steps += step.shortened
        self.temporal_error += step.local_error
        self.outcome = self._decide()
        self._depart()

    def _enters_averages(self, step: Step) -> bool:
        """Return whether a step may enter averages: after the first passage, or in the second half."""
        return bool(self.tracker.passages) if self.tracker else step.end > self._scene.horizon / 2

    def _decide(self) -> Outcome:
        history = self._history
        decisions = (criterion.decide(history) for criterion in self._criteria)
        return next((outcome for outcome in decisions if outcome), Outcome.UNDECIDED)

    def _examined(self) -> Rest:
        """Find out what is behind the present state."""
        assert self._examine
        membranes = self.segment.membranes
        return self._examine(membranes, self.state[: membranes.state_size])

    @property
    def undecided(self) -> str | None:
        """Why the run is undecided, as far as its criteria say."""
        if self.outcome is not Outcome.UNDECIDED:
            return None
        history = self._history
        lacking = (criterion.lacking(history) for criterion in self._criteria)
        return "; ".join(reason for reason in lacking if reason) or None

    @property
    def _history(self) -> History:
        return History(
            time=self.time,
            state=self.state,
            membranes=self.segment.membranes,
            sample=self.recorder.sample,
            line_of_centers=self._line_of_centers,
            long_axis=self._long_axis,
            examine=self._examined if self._examine else None,
        )
