"""The errors of answers, read off along the trajectory without the estimated error of the state."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.state_error import magnitude
from solver.integrators.control import root_mean_square
from solver.memory import Remembering, Saved

if TYPE_CHECKING:
    from solver.analysis.revolutions import RevolutionTracker
    from solver.integrators import Step

Array = NDArray[np.float64]
Quantity = Callable[[Array], float]  # of a state

_SAFETY = 3.0  # factor within which an estimated error is trusted
_SAMPLES = 16  # of a turn; what is averaged over it is smooth
_FEWEST_SAMPLES = 4
_MOST_SAMPLES = 1024  # that are kept to choose from; of a longer turn every other step, or fewer
_REST = 0.1  # share of the errors at single instants that an average keeps
_LARGEST = 1e-2  # root mean square of the error of a state with which quantities change linearly
_LARGEST_TRANSVERSE = 0.1  # root mean square; the pair may be on the way to another state
_PART = 1e-3  # of a step, over which a quantity is taken to change linearly


class _Sample(NamedTuple):
    number: int  # of the step
    time: float
    state: Array
    error: Array  # (state_size, 2), see `Step`
    slope: Array  # of the state


class AnswerErrors(Remembering):
    """Follows a run, and compares its answers with those of the trajectory y − e.

    Parameters
    ----------
    tracker : RevolutionTracker or None
        Of the line of centers or the long axis, where one is followed.

    Attributes
    ----------
    sensitive : bool
        Whether a pair would have, or might have, stayed together or come apart with an error three times as
        large as the estimated one.
    """

    memory = ("_at_passages", "_samples", "_steps", "_every", "_size", "_separation", "sensitive")

    def __init__(self, tracker: RevolutionTracker | None) -> None:
        self._tracker = tracker
        self._at_passages: list[Array] = []
        self._samples: list[_Sample] = []
        self._steps = 0
        self._every = 1  # of so many steps one is kept
        self._size = 0  # of the last state
        self._separation: Array | None = None
        self.sensitive = False

    def count_from_here(self) -> None:
        """Forget the passages so far, as the tracker does."""
        self._at_passages, self._samples = [], []

    def restore(self, saved: Saved) -> None:
        """Remember what another one did; see `Remembering`.

        Parameters
        ----------
        saved : dict
        """
        super().restore(saved)
        self._samples = [_Sample(*sample) for sample in self._samples]

    def follow(self, step: Step) -> None:
        """Take in a step after the tracker has.

        Parameters
        ----------
        step : Step
            The part that was followed.
        """
        tracker = self._tracker
        if tracker is None or step.error is None:
            return
        for time in tracker.latest:
            angle = partial(tracker.angle_of, time=time)
            error_of_time = _time_error(step, time, angle) if time > 0 else np.zeros(2)
            self._at_passages = [*self._at_passages, error_of_time][-3:]
        if tracker.latest:
            begin = tracker.passages[-3:][0]
            self._samples = [sample for sample in self._samples if sample.time >= begin]
            if len(self._samples) < _MOST_SAMPLES // 4:
                self._every = max(self._every // 2, 1)
        error = step.error(step.end)
        part = _PART * (step.end - step.start)
        if tracker.passages and part > 0:  # what was before the first one is in no turn
            slope = (step.state - step.interpolate(step.end - part)) / part
            self._keep(_Sample(self._steps, step.end, step.state, error, slope))
        self._steps += 1
        self._size = step.state.size
        if isinstance(tracker, LineOfCenters):
            self._follow_distance(step, error, tracker)
            self.sensitive |= _transverse_error(step, error[:, 0]) > _LARGEST_TRANSVERSE

    @property
    def period(self) -> float | None:
        """That of the duration of the last full turn; None before there is one."""
        if len(self._at_passages) < 3:
            return None
        return magnitude(self._at_passages[-1] - self._at_passages[-3])

    @property
    def separation(self) -> float | None:
        """That of the time at which a pair came apart; None as long as it has not."""
        return None if self._separation is None else magnitude(self._separation)

    def of_average(self, quantity: Quantity) -> float | None:
        """Return that of the average of a quantity over the last full turn.

        Parameters
        ----------
        quantity : callable
            From a state to a number.

        Returns
        -------
        float or None
            None before there is a full turn, or where the number of points has changed in it.
        """
        if self.period is None or self._tracker is None:
            return None
        first, last = self._tracker.passages[-3], self._tracker.passages[-1]
        inside = [sample for sample in self._samples if first <= sample.time <= last]
        if len(inside) < _FEWEST_SAMPLES or any(sample.state.size != self._size for sample in inside):
            return None
        numbers = np.array([s.number for s in inside])
        wanted = numbers[0] + np.linspace(0, numbers[-1] - numbers[0], _SAMPLES).astype(int)
        chosen = [inside[k] for k in np.unique(np.searchsorted(numbers, wanted))]
        times = np.array([first, *(s.time for s in chosen), last])
        leads = self._leads(times)
        others = [
            s.error - np.multiply.outer(s.slope, lead) for s, lead in zip(chosen, leads[1:-1], strict=True)
        ]
        values = np.array([quantity(s.state) for s in chosen])
        changes = np.array(
            [change_of(quantity, s.state, other) for s, other in zip(chosen, others, strict=True)]
        )
        if not np.all(np.isfinite(changes)):
            return np.inf
        # To the first and the last of them belong the values next to them.
        columns = np.column_stack([values, changes])
        columns = np.vstack([columns[:1], columns, columns[-1:]])
        mean, *change = np.trapezoid(columns, times, axis=0) / (last - first)
        # A lead changes an average as far as it changes in the turn, which is that of the trajectory y − e.
        apart = 0.5 * (columns[1:, 0] + columns[:-1, 0]) - mean
        change = change - apart @ np.diff(leads, axis=0) / (last - first)
        # Errors of opposite signs cancel in an average, but not to the last digit.
        rest = _REST * float(np.abs(changes[:, 0]).mean())
        return float(np.hypot(magnitude(change), rest))

    def _leads(self, times: Array) -> Array:
        """Return how far ahead in time the errors put the run at times (n,) of the last turn, (n, 2).

        It is known at the passages, and taken to change linearly from one to the next.
        """
        assert self._tracker is not None
        passages, late = self._tracker.passages[-3:], np.transpose(self._at_passages)
        return -np.column_stack([np.interp(times, passages, each) for each in late])

    def _keep(self, sample: _Sample) -> None:
        if sample.number % self._every == 0:
            self._samples.append(sample)
        if len(self._samples) > _MOST_SAMPLES:
            self._every *= 2
            self._samples = [each for each in self._samples if each.number % self._every == 0]

    def _follow_distance(self, step: Step, error: Array, line: LineOfCenters) -> None:
        """Take in the distance at the end of a step, where the state has an error (state_size, 2)."""
        distance, size = line.distance_of, line.distance_of(step.state)
        change = change_of(distance, step.state, error)
        if line.separated:
            self._separation = _time_error(step, step.end, distance)
            # Would it move apart without the error?
            assert step.error is not None
            before = step.end - _PART * (step.end - step.start)
            state = step.interpolate(before)
            difference = change - change_of(distance, state, step.error(before))
            self.sensitive |= size - distance(state) <= _SAFETY * magnitude(difference)
        else:
            self.sensitive |= size + _SAFETY * magnitude(change) >= line.separated_distance


def change_of(quantity: Quantity, state: Array, error: Array) -> Array:
    """Return how much an error of the state changes a quantity, to first order.

    Parameters
    ----------
    quantity : callable
        From a state to a number.
    state : (state_size,)
    error : (state_size, 2)

    Returns
    -------
    (2,)
        For each column of the error.  Infinite if the state without the error has no motion.
    """
    value = quantity(state)
    changes = []
    for column in error.T:
        size = root_mean_square(column)
        part = min(1.0, _LARGEST / size) if size > 0 else 1.0
        try:
            changes.append((value - quantity(state - part * column)) / part)
        except ArithmeticError:
            changes.append(np.inf)
    return np.array(changes)


def _time_error(step: Step, time: float, quantity: Quantity) -> Array:
    """Return how much later than without errors a quantity comes to its value at a time, (2,)."""
    assert step.error is not None
    state, later = step.interpolate(time), time + _PART * (step.end - step.start)
    rate = (quantity(step.interpolate(later)) - quantity(state)) / (later - time)
    return -change_of(quantity, state, step.error(time)) / rate if rate else np.full(2, np.inf)


def _transverse_error(step: Step, error: Array) -> float:
    """Return an error (n,) at the end of a step without what only delays or hastens the motion."""
    motion = step.state - step.interpolate(step.start)
    if (square := motion @ motion) > 0:
        error = error - (error @ motion) / square * motion
    return root_mean_square(error)
