"""When a run is decided, and how.

Each criterion looks at the run so far and says what it has become, or nothing.  They are asked in order
after every step, so a decided run takes no further one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.revolutions import LongAxisTracker
from solver.analysis.run import Outcome
from solver.membrane import curve
from solver.motion.equation import EquationOfMotion
from solver.scene import Criteria, Scene


@dataclass(frozen=True)
class History:
    """The run so far: recorded diagnostics by name, the last state and the lines that are followed.

    orbit : of two vesicles
    axis : of one that may tumble (`may_tumble`)
    """

    samples: Mapping[str, Sequence[float]]
    dynamics: EquationOfMotion
    orbit: LineOfCenters | None
    state: np.ndarray
    axis: LongAxisTracker | None = None


class Criterion(Protocol):
    """Decides runs."""

    def decide(self, history: History) -> Outcome | None:
        """The outcome, or None while it is open."""


class Separated:
    """The centers have passed a stated distance, moving apart."""

    def decide(self, history: History) -> Outcome | None:
        """See `Criterion`."""
        assert history.orbit
        return Outcome.SEPARATED if history.orbit.separated else None


class Revolved:
    """The line of centers has made full turns and the gap opened no wider in the last half turn than before.

    A pair of vesicles slides open once in every half turn.
    """

    def __init__(self, criteria: Criteria) -> None:
        self._half_turns = 2 * criteria.revolutions
        self._growth = criteria.gap_growth
        self._judged = 0

    def decide(self, history: History) -> Outcome | None:
        """See `Criterion`."""
        orbit = history.orbit
        assert orbit
        completed = len(orbit.half_turns) - 1
        if completed < self._half_turns or completed == self._judged:
            return None
        self._judged = completed
        earlier, previous, last = orbit.half_turns[-3:]
        time, gap = np.array(history.samples["time"]), np.array(history.samples["gap"])
        before = gap[(time >= earlier) & (time <= previous)].max(initial=0.0)
        after = gap[(time >= previous) & (time <= last)].max(initial=0.0)
        return Outcome.BOUND if after <= (1 + self._growth) * before else None


class Tumbled:
    """The long axis of a single vesicle has made full turns."""

    def __init__(self, criteria: Criteria) -> None:
        self._half_turns = 2 * criteria.revolutions

    def decide(self, history: History) -> Outcome | None:
        """See `Criterion`."""
        assert history.axis
        return Outcome.TUMBLING if len(history.axis.half_turns) > self._half_turns else None


class Steady:
    """Shapes and arrangement have stayed for a while.

    What that means depends on the scene: at rest it is `EQUILIBRIUM`; two vesicles in a straining flow are
    `BOUND` side by side or held `END_TO_END`; anything else is `STEADY`.
    """

    def __init__(self, scene: Scene) -> None:
        self._criteria = scene.criteria
        self._quiescent = scene.flow is None
        self._pair_in_strain = scene.flow is not None and scene.flow.strains and len(scene.vesicles) == 2

    def decide(self, history: History) -> Outcome | None:
        """See `Criterion`."""
        time, rate = history.samples["time"], history.samples["state_rate"]
        since = time[-1] - self._criteria.steady_time
        if time[0] > since:
            return None
        for instant, value in zip(reversed(time), reversed(rate), strict=True):
            if value > self._criteria.steady_rate:
                return None
            if instant <= since:
                break
        if self._quiescent:
            return Outcome.EQUILIBRIUM
        return self._arrangement(history) if self._pair_in_strain else Outcome.STEADY

    @staticmethod
    def _arrangement(history: History) -> Outcome:
        """Side by side, or tip to tip: long axes across the line of centers, or along it."""
        orbit, membranes = history.orbit, history.dynamics.membranes
        assert orbit
        points = curve.positions(
            membranes.tangent_angle(history.state), membranes.center(history.state), membranes.length
        )
        along = np.abs(np.cos(curve.inclination(points) - orbit.angle)).mean()
        return Outcome.END_TO_END if along > np.cos(np.pi / 4) else Outcome.BOUND


def criteria_of(scene: Scene) -> tuple[Criterion, ...]:
    """The criteria that apply to a scene, in the order in which they are asked."""
    pair = len(scene.vesicles) == 2
    found: list[Criterion] = [Separated()] if pair else []
    if may_tumble(scene):
        found.append(Tumbled(scene.criteria))
    if pair and scene.flow and scene.flow.rotates:
        found.append(Revolved(scene.criteria))
    else:
        found.append(Steady(scene))
    return tuple(found)


def may_tumble(scene: Scene) -> bool:
    """Whether the scene is a single vesicle with a long axis, in a flow that rotates it."""
    rotates = scene.flow is not None and scene.flow.rotates
    return len(scene.vesicles) == 1 and rotates and scene.vesicles[0].reduced_area < 1


def latest_time(scene: Scene) -> float:
    """When a run ends at the latest: a pair whose fate is the question may go on beyond the horizon."""
    open_question = len(scene.vesicles) == 2 and scene.flow is not None and scene.flow.extends_pairs
    return scene.horizon * (scene.criteria.extensions if open_question else 1.0)
