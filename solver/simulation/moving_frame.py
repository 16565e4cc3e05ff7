"""The frame that moves with the mean of the vesicles' centers, in a flow that carries them away.

In a flow u = A x vesicles move relative to the mean X of their centers as if the flow were A (x − X).  So a
run computes them in a frame about that mean, where they stay near the origin, and adds where the frame is:

    X' = A X + v,    X(t) = exp(At) X(0) + ∫₀ᵗ exp(A(t − s)) v(s) ds,

with the velocity v of the mean in the frame (README, S11a).  Where the rate changes with time, A t is the
integral of A over time.  Without the frame a pair near a stagnation point
loses its digits exponentially: in extension at the rate ε its distance from there grows like exp(εt), and so
does every error of its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from solver.integrators.integrator import StepFailedError
from solver.memory import Remembering

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.integrators import Step
    from solver.membrane.geometry import Membranes
    from solver.scene import Scene

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # within a step, as accurate as any integrator


class MovingFrame(Remembering):
    """Follows the mean of the centers in the fluid.

    Parameters
    ----------
    flow : ImposedFlow
        In the fluid, with the same gradient everywhere.
    scene : Scene
        As it is in the frame.
    start : (2,)
        Mean of the centers at time 0 in the fluid.  In the frame it is at the origin.

    Attributes
    ----------
    scene : Scene
    """

    memory = ("_reached",)  # a step is not known before the next one

    def __init__(self, flow: ImposedFlow, scene: Scene, start: Array) -> None:
        self.scene = scene
        self._protocol = scene.protocol
        self._gradient = np.array(flow.velocity_gradient(np.zeros((2, 1)))[:, :, 0])
        self._mean = start  # where the last step began
        self._reached = start, start  # the mean and the origin where it ended
        self._step: Step | None = None
        self._membranes: Membranes | None = None

    @classmethod
    def of_scene(cls, scene: Scene) -> Self | None:
        """Return the frame in which a scene is computed, None if its flow asks for none.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        MovingFrame or None
        """
        flow = scene.flow
        if flow is None or flow.comoving is None:
            return None
        centers = np.array([vesicle.center for vesicle in scene.vesicles])
        mean = centers.mean(axis=0)
        # Of two the second one is placed opposite to the first, to the last bit.
        offsets = centers - mean if len(centers) != 2 else np.outer([-0.5, 0.5], centers[1] - centers[0])
        vesicles = tuple(
            vesicle.model_copy(update={"center": tuple(offset.tolist())})
            for vesicle, offset in zip(scene.vesicles, offsets, strict=True)
        )
        within = scene.model_copy(update={"flow": flow.comoving, "vesicles": vesicles})
        # A relaxed pair begins at the origin.
        return cls(flow, within, np.zeros(2) if scene.start.relaxed else mean)

    def follow(self, step: Step, membranes: Membranes) -> None:
        """Go on to the end of a step.

        Parameters
        ----------
        step : Step
            The one after the last that was followed.
        membranes : Membranes
            Those of the step.

        Raises
        ------
        StepFailedError
            If the place of the frame is no finite number any more.
        """
        self._mean, _ = self._reached
        self._step, self._membranes = step, membranes
        with np.errstate(over="ignore", invalid="ignore"):
            self._reached = self._at(step.end)
            if not np.all(np.isfinite(self._reached)):
                raise StepFailedError(
                    f"at time {step.end:g} the flow has carried the vesicles beyond all numbers"
                )

    def origin(self, time: float) -> Array:
        """Return where the origin of the frame is in the fluid.

        Parameters
        ----------
        time : float
            Within the last step, or 0 before the first one.

        Returns
        -------
        (2,)
        """
        return self._at(time)[1]

    def _at(self, time: float) -> tuple[Array, Array]:
        """Return the mean of the centers, and the origin of the frame, in the fluid."""
        step = self._step
        if step is None:
            return self._reached
        elapsed = time - step.start
        whole = expm(self._gradient * self._at_full_rate(time, elapsed))
        mean = whole @ self._mean
        if self._membranes and self._membranes.multiplicity == 1:
            # By parts, with the mean c of the centers in the frame, ∫ exp(A(t − s)) c' ds.
            begin, end = self._within(step.start), self._within(time)
            mean += end - whole @ begin
            for node, weight in zip(_NODES, _WEIGHTS, strict=True):
                left = 0.5 * elapsed * (1 - node)
                carried = expm(self._gradient * self._at_full_rate(time, left))
                moved = carried @ self._gradient @ self._within(time - left)
                factor = self._protocol.factor(time - left) if self._protocol else 1.0
                mean += 0.5 * elapsed * weight * factor * moved
        else:
            end = np.zeros(2)
        return mean, mean - end

    def _at_full_rate(self, time: float, before: float) -> float:
        """Return how long the flow at its full rate takes for what it does in some time up to a time."""
        if self._protocol is None:
            return before
        return self._protocol.integral(time) - self._protocol.integral(time - before)

    def _within(self, time: float) -> Array:
        """Return the mean of the centers in the frame."""
        assert self._step
        assert self._membranes
        state = self._step.state if time == self._step.end else self._step.interpolate(time)
        return np.asarray(self._membranes.curve_center(state).mean(axis=0))
