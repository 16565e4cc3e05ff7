"""Measures the states of a run while it goes on, and hands the diagnostics and frames to a sink."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.contacts import cluster_sizes
from solver.analysis.diagnostics import measures, vesicle_measures
from solver.analysis.record import FRAMES, SERIES, VESICLE_SERIES, OpenBlock
from solver.analysis.settling import state_rate
from solver.analysis.spatial_error import shape_tails, spatial_error
from solver.membrane.geometry import Geometry
from solver.membrane.resampling import resampled_state
from solver.membrane.restoring import shape_rates
from solver.membrane.symmetry import independent_vesicles
from solver.memory import Remembering
from solver.motion.equation import EquationOfMotion, Motion
from solver.potentials.proximity import waist_error

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.analysis.line_of_centers import LineOfCenters
    from solver.analysis.record import Sink
    from solver.integrators import Step
    from solver.scene import Scene

Array = NDArray[np.float64]


class Recorder(Remembering):
    """Measures states, and hands diagnostics and frames over block by block.

    Parameters
    ----------
    scene : Scene
    equation : EquationOfMotion
        Of this scene.
    line_of_centers : LineOfCenters or None
        Of two vesicles.
    sink : Sink
        That takes what is recorded.
    origin : callable or None
        From a time to where the origin of the states lies in the fluid, (2,); None if it stays at 0.

    Attributes
    ----------
    sample : dict of str to float
        The last values of the diagnostics, by the name of their series; empty before the first ones.
    frame : dict of str to float or array
        The last frame: a row of `solver.analysis.run.Frames`.
    largest : dict of str to float
        The largest values so far of the errors of area and closure.
    spatial_error : float
        The largest so far; see `solver.analysis.run.Errors`.
    spatial_position_error : float
        The largest so far; see `solver.analysis.spatial_error.spatial_error`.
    """

    memory = (
        "sample",
        "frame",
        "largest",
        "spatial_error",
        "spatial_position_error",
        "_previous",
        "_series",
        "_vesicle_series",
        "_frames",
    )

    def __init__(
        self,
        scene: Scene,
        equation: EquationOfMotion,
        line_of_centers: LineOfCenters | None,
        sink: Sink,
        origin: Callable[[float], Array] | None = None,
    ) -> None:
        self._scene = scene
        self._line_of_centers = line_of_centers
        self._origin = origin
        self._vesicle_measures = vesicle_measures(scene)
        self._series = OpenBlock(SERIES, sink)
        self._vesicle_series = OpenBlock(VESICLE_SERIES, sink)
        self._frames = OpenBlock(FRAMES, sink)
        self._previous: tuple[float, Array] | None = None
        self.sample: dict[str, float] = {}
        self.frame: dict[str, float | Array] = {}
        self.largest = {"area_error": 0.0, "closure_error": 0.0}
        self.spatial_error = self.spatial_position_error = 0.0
        self._shape_rates = shape_rates(independent_vesicles(scene), scene)
        self._take_equation(equation)

    def continue_with(self, equation: EquationOfMotion) -> None:
        """Record states with more points from now on.

        Parameters
        ----------
        equation : EquationOfMotion
            Of the same scene with more points.
        """
        if self._previous:
            time, state = self._previous
            self._previous = time, resampled_state(self._membranes, state, equation.membranes)
        if equation.membranes.points != self._membranes.points:
            self._frames.hand_over()  # those of a block have the same number of points
        self._take_equation(equation)

    def _take_equation(self, equation: EquationOfMotion) -> None:
        self._equation = equation
        self._membranes = equation.membranes
        self._measures = measures(self._scene, equation)

    def record(self, time: float, state: Array) -> None:
        """Measure a state, and keep it as a frame if one is due.

        Parameters
        ----------
        time : float
            Later than what was recorded before.
        state : (state_size,)

        Raises
        ------
        TensionNotFoundError
            If its membranes are too distorted.
        """
        self._record(time, state, self._equation.motion(state))

    def record_geometry(self, time: float, state: Array) -> None:
        """Record a state in which no motion could be computed; what depends on one is NaN.

        Parameters
        ----------
        time : float
        state : (state_size,)
        """
        self._record(time, state, _unknown_motion(Geometry(self._membranes, state)))

    def record_up_to(self, step: Step) -> None:
        """Record the multiples of the scene's interval that a step has passed.

        Parameters
        ----------
        step : Step
        """
        interval = self._scene.output.interval
        recorded = round(self.sample["time"] / interval)
        for index in range(recorded + 1, int(np.floor(step.end / interval)) + 1):
            time = index * interval
            # At its end the interpolant differs from the state by round-off.
            self.record(time, step.state if time == step.end else step.interpolate(time))

    def finish(self, time: float, state: Array) -> None:
        """Measure the last state, unless it is recorded already, and keep it as a frame.

        Parameters
        ----------
        time : float
        state : (state_size,)
        """
        if time > self.sample["time"]:
            self.record(time, state)
        if time > self.frame["time"]:
            self._keep(time, state, self._equation.motion(state))

    def hand_over(self) -> None:
        """Give all that is recorded to the sink."""
        for block in (self._series, self._vesicle_series, self._frames):
            block.hand_over()

    def _record(self, time: float, state: Array, motion: Motion) -> None:
        sample = {"time": float(time)}
        if self._scene.flow and self._scene.protocol:
            sample["flow_rate"] = self._scene.flow.rate * self._scene.protocol.factor(time)
        sample |= {name: float(measure(motion)) for name, measure in self._measures.items()}
        if self._line_of_centers:
            sample["center_distance"] = self._line_of_centers.distance_of(state)
            sample["center_angle"] = self._line_of_centers.angle_of(state, time)
        # Between samples: at one, the rate of a stiff state magnifies the noise of the integrator.
        if self._previous:
            change, duration = state - self._previous[1], time - self._previous[0]
        else:
            change, duration = motion.rate, 1.0
        sample["state_rate"] = state_rate(self._membranes, change, duration)
        self._previous = time, state
        if self._vesicle_measures:
            sample |= self._record_vesicles(time, motion)
        self.sample = sample
        self._series.add(sample)
        self.largest = {
            name: float(np.maximum(so_far, sample[name])) for name, so_far in self.largest.items()
        }
        self._assess_resolution(time, state, motion)
        if self._frame_is_due(time):
            self._keep(time, state, motion)

    def _record_vesicles(self, time: float, motion: Motion) -> dict[str, float]:
        """Record what is measured of each vesicle; return the diagnostics of all that follow from it."""
        row = {name: measure(motion) for name, measure in self._vesicle_measures.items()}
        if self._origin and "vesicle_center" in row:
            row["vesicle_center"] = row["vesicle_center"] + self._origin(time)
        self._vesicle_series.add(row)
        if "vesicle_cluster" not in row:
            return {}
        sizes = cluster_sizes(row["vesicle_cluster"])
        return {"clusters": float(len(sizes)), "largest_cluster": float(sizes.max())}

    def _assess_resolution(self, time: float, state: Array, motion: Motion) -> None:
        """Note how well the points resolve the shapes, the waists, and adhesion at the smallest gap."""
        tails, waists = shape_tails(self._membranes, state), waist_error(motion.geometry)
        of_positions = float(spatial_error(tails, self._shape_rates * time).max())
        errors = [of_positions, float(waists.max())]
        adhesion = self._equation.adhesion
        if adhesion and motion.closeness:
            errors.append(adhesion.sum_error(motion.closeness))
        self.spatial_error = max(self.spatial_error, *errors)
        self.spatial_position_error = max(self.spatial_position_error, of_positions)

    def _keep(self, time: float, state: Array, motion: Motion) -> None:
        membranes = self._membranes
        tension = np.tile(motion.tension, (membranes.multiplicity, 1))
        centers = membranes.curve_center(state)
        if self._origin:
            centers = centers + self._origin(time)
        self.frame = {
            "time": time,
            "tangent_angle": membranes.curve_tangent_angle(state),
            "center": centers,
            "tension": tension,
        }
        self._frames.add(self.frame)

    def _frame_is_due(self, time: float) -> bool:
        if not self.frame:
            return True
        # Round-off in a multiple of the interval must not skip a frame.
        interval = self._scene.output.frame_interval
        due, last = (np.floor(t / interval + 1e-9) for t in (time, self.frame["time"]))
        return bool(due > last)


def _unknown_motion(geometry: Geometry) -> Motion:
    """Return a motion of which only the geometry is known."""
    scalar, vector = np.full(geometry.tangent_angle.shape, np.nan), np.full(geometry.points.shape, np.nan)
    return Motion(
        geometry=geometry,
        closeness=None,
        velocity=vector,
        rotation_rate=scalar,
        tension=scalar,
        bending=vector,
        adhesion=vector,
        restoring=None,
    )
