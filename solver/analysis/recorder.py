"""Collects the diagnostics and the states of a run while it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.contacts import cluster_sizes
from solver.analysis.diagnostics import measures, vesicle_measures
from solver.analysis.run import Frames, Series, VesicleSeries
from solver.analysis.settling import state_rate
from solver.analysis.spatial_error import shape_tails, spatial_error
from solver.membrane.geometry import Geometry
from solver.membrane.resampling import resampled_angle, resampled_state
from solver.membrane.restoring import shape_rates
from solver.membrane.spectral import resampled
from solver.membrane.symmetry import independent_vesicles
from solver.memory import Remembering
from solver.motion.equation import EquationOfMotion, Motion
from solver.potentials.proximity import waist_error

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.analysis.line_of_centers import LineOfCenters
    from solver.integrators import Step
    from solver.scene import Scene

Array = NDArray[np.float64]


class Recorder(Remembering):
    """Collects diagnostics, and states as frames.

    Parameters
    ----------
    scene : Scene
    equation : EquationOfMotion
        Of this scene.
    line_of_centers : LineOfCenters or None
        Of two vesicles.
    origin : callable or None
        From a time to where the origin of the states lies in the fluid, (2,); None if it stays at 0.

    Attributes
    ----------
    samples : dict
        Values of the diagnostics so far by the name of their series.
    spatial_error : float
        The largest so far; see `solver.analysis.run.Errors`.
    spatial_position_error : float
        The largest so far; see `solver.analysis.spatial_error.spatial_error`.
    """

    memory = (
        "samples",
        "spatial_error",
        "spatial_position_error",
        "_vesicle_samples",
        "_frames",
        "_previous",
    )

    def __init__(
        self,
        scene: Scene,
        equation: EquationOfMotion,
        line_of_centers: LineOfCenters | None,
        origin: Callable[[float], Array] | None = None,
    ) -> None:
        self._scene = scene
        self._line_of_centers = line_of_centers
        self._origin = origin
        self._vesicle_measures = vesicle_measures(scene)
        self._frames: list[tuple[float, Array, Array, Array]] = []
        self._previous: tuple[float, Array] | None = None
        self._vesicle_samples: dict[str, list[Array]] = {}
        self.samples: dict[str, list[float]] = {}
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
        recorded = round(self.samples["time"][-1] / interval)
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
        if time > self.samples["time"][-1]:
            self.record(time, state)
        if time > self._frames[-1][0]:
            self._keep(time, state, self._equation.motion(state))

    def _record(self, time: float, state: Array, motion: Motion) -> None:
        self._append("time", time)
        for name, measure in self._measures.items():
            self._append(name, measure(motion))
        for name, measure_each in self._vesicle_measures.items():
            self._vesicle_samples.setdefault(name, []).append(measure_each(motion))
        if self._origin and "vesicle_center" in self._vesicle_samples:
            centers = self._vesicle_samples["vesicle_center"]
            centers[-1] = centers[-1] + self._origin(time)
        if self._line_of_centers:
            self._append("center_distance", self._line_of_centers.distance_of(state))
            self._append("center_angle", self._line_of_centers.angle_of(state))
        # Between samples: at one, the rate of a stiff state magnifies the noise of the integrator.
        if self._previous:
            change, duration = state - self._previous[1], time - self._previous[0]
        else:
            change, duration = motion.rate, 1.0
        self._append("state_rate", state_rate(self._membranes, change, duration))
        self._previous = time, state
        self._assess_resolution(time, state, motion)
        if self._frame_is_due(time):
            self._keep(time, state, motion)

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
        self._frames.append((time, membranes.curve_tangent_angle(state), centers, tension))

    def _append(self, name: str, value: float) -> None:
        self.samples.setdefault(name, []).append(value)

    def _frame_is_due(self, time: float) -> bool:
        if not self._frames:
            return True
        # Round-off in a multiple of the interval must not skip a frame.
        interval = self._scene.output.frame_interval
        due, last = (np.floor(t / interval + 1e-9) for t in (time, self._frames[-1][0]))
        return bool(due > last)

    @property
    def series(self) -> Series:
        """All diagnostics."""
        series = {name: np.array(values) for name, values in self.samples.items()}
        if "vesicle_cluster" in self._vesicle_samples:
            sizes = [cluster_sizes(labels) for labels in self._vesicle_samples["vesicle_cluster"]]
            series["clusters"] = np.array([float(len(of_sample)) for of_sample in sizes])
            series["largest_cluster"] = np.array([float(of_sample.max()) for of_sample in sizes])
        return series

    @property
    def vesicle_series(self) -> VesicleSeries:
        """All diagnostics of each vesicle."""
        return {name: np.array(values) for name, values in self._vesicle_samples.items()}

    @property
    def frames(self) -> Frames:
        """All recorded states, with the last one's number of points."""
        time, tangent_angle, center, tension = zip(*self._frames, strict=True)
        points = self._membranes.points
        return Frames(
            np.array(time),
            np.array([resampled_angle(angle, points) for angle in tangent_angle]),
            np.array(center),
            np.array([resampled(values, points) for values in tension]),
        )


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
