"""What is measured along a run, and recorded at equal intervals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.analysis.contacts import CONTACT, cluster_sizes, clusters
from solver.analysis.line_of_centers import LineOfCenters
from solver.analysis.rheology import adhesion_stress, membrane_stress
from solver.analysis.run import Frames, Series, VesicleSeries
from solver.membrane import curve
from solver.membrane.geometry import Membranes
from solver.membrane.spectral import resampled
from solver.membrane.symmetry import independent_vesicles
from solver.motion.equation import EquationOfMotion, Motion
from solver.potentials.proximity import gap, waist_error
from solver.simulation.resolution import carried, resampled_angle, shape_tails

Array = NDArray[np.float64]
Measure = Callable[[Motion], float]
VesicleMeasure = Callable[[Motion], Array]

_MANY = 3  # vesicles, from which on each of them is measured


def state_rate(membranes: Membranes, change: Array, duration: float) -> float:
    """Largest rate at which any tangent angle, or any center relative to their mean, changed.

    Zero when shapes and arrangement stay: the points glide (`tangential_speed`), so treading does not count.
    """
    rotation_rate, moving = membranes.tangent_angle(change), membranes.curve_center(change)
    relative = moving - moving.mean(axis=0)
    return float(max(np.abs(rotation_rate).max(), np.abs(relative).max()) / duration)


def measures(setting: scene.Scene, dynamics: EquationOfMotion) -> dict[str, Measure]:
    """The diagnostics that a scene has, by the name of their series."""
    vesicles = independent_vesicles(setting)
    target_area = np.array([v.reduced_area * v.length**2 / (4 * np.pi) for v in vesicles])

    found: dict[str, Measure] = {
        "bending_energy": lambda motion: dynamics.bending.energy(motion.geometry),
        "area_error": lambda motion: float(np.max(np.abs(motion.geometry.areas / target_area - 1))),
        "closure_error": lambda motion: float(curve.closure(motion.geometry.tangents.swapaxes(0, 1)).max()),
    }
    adhesion = dynamics.adhesion
    if adhesion:

        def adhesion_energy(motion: Motion) -> float:
            assert motion.closeness is not None
            return adhesion.energy(motion.geometry, motion.closeness)

        found["adhesion_energy"] = adhesion_energy
    if len(setting.vesicles) > 1:
        found["gap"] = lambda motion: gap(motion.geometry)
    else:
        found["inclination_angle"] = lambda motion: float(curve.inclination(motion.geometry.points[:, 0]))
    shear_rate = setting.flow.shear_rate if setting.flow else None
    if shear_rate:
        scale = 1 / (shear_rate * dynamics.membranes.copies * target_area.sum())
        found["viscosity_bending_tension"] = lambda motion: scale * membrane_stress(motion)
        if adhesion:
            found["viscosity_adhesion"] = lambda motion: scale * adhesion_stress(motion)
        contrast = dynamics.contrast
        if contrast:
            found["viscosity_contrast"] = lambda motion: (
                scale * contrast.stress(motion.geometry, motion.velocity)
            )
    return found


def vesicle_measures(setting: scene.Scene) -> dict[str, VesicleMeasure]:
    """What is measured of every vesicle of a scene of many, by the name of its series."""
    if len(setting.vesicles) < _MANY:
        return {}
    target_area = np.array([v.reduced_area * v.length**2 / (4 * np.pi) for v in setting.vesicles])
    found: dict[str, VesicleMeasure] = {
        "vesicle_center": lambda motion: motion.geometry.centers.T,
        "vesicle_inclination_angle": lambda motion: curve.inclination(motion.geometry.points.swapaxes(0, 1)),
        "vesicle_area_error": lambda motion: motion.geometry.areas / target_area - 1,
    }
    if setting.adhesion:
        contact = CONTACT * setting.adhesion.distance
        found["vesicle_cluster"] = lambda motion: clusters(motion.geometry, contact)
    return found


class Recorder:
    """Collects diagnostics and frames."""

    def __init__(self, setting: scene.Scene, dynamics: EquationOfMotion, orbit: LineOfCenters | None) -> None:
        self._setting = setting
        self._dynamics = dynamics
        self._orbit = orbit
        self._measures = measures(setting, dynamics)
        self._vesicle_measures = vesicle_measures(setting)
        self._frame_interval = setting.output.frame_interval
        self._frames: list[tuple[float, Array, Array, Array]] = []
        self._previous: tuple[float, Array] | None = None
        self.values: dict[str, list[float]] = {}
        self._vesicle_values: dict[str, list[Array]] = {}
        self.spatial_error = 0.0

    def continue_with(self, dynamics: EquationOfMotion) -> None:
        """Take states of the same membranes with more points from now on."""
        if self._previous:
            time, state = self._previous
            self._previous = time, carried(self._dynamics.membranes, state, dynamics.membranes)
        self._dynamics = dynamics
        self._measures = measures(self._setting, dynamics)

    def record(self, time: float, state: Array) -> None:
        """Measure a state, and keep it as a frame if one is due."""
        motion = self._dynamics.motion(state)
        self._append("time", time)
        for name, measure in self._measures.items():
            self._append(name, measure(motion))
        for name, measure_each in self._vesicle_measures.items():
            self._vesicle_values.setdefault(name, []).append(measure_each(motion))
        if self._orbit:
            self._append("center_distance", self._orbit.distance_of(state))
            self._append("center_angle", self._orbit.angle_of(state))
        membranes = self._dynamics.membranes
        # Between samples: at one, the rate of a stiff state magnifies the noise of the integrator.
        if self._previous:
            change, duration = state - self._previous[1], time - self._previous[0]
        else:
            change, duration = motion.rate, 1.0
        self._append("state_rate", state_rate(membranes, change, duration))
        self._previous = time, state
        self.spatial_error = max(self.spatial_error, *self._spatial_errors(motion, state))
        if self._frame_is_due(time):
            self._keep(time, state, motion)

    def _spatial_errors(self, motion: Motion, state: Array) -> list[float]:
        """Of the shapes, across waists, and of adhesion at the smallest gap."""
        tails, waists = shape_tails(self._dynamics.membranes, state), waist_error(motion.geometry)
        errors = [float(tails.max()), float(waists.max())]
        adhesion = self._dynamics.adhesion
        if adhesion and motion.closeness:
            errors.append(adhesion.sum_error(motion.closeness))
        return errors

    def finish(self, time: float, state: Array) -> None:
        """Measure the last state, unless it is recorded already, and keep it as a frame."""
        if time > self.values["time"][-1]:
            self.record(time, state)
        if time > self._frames[-1][0]:
            self._keep(time, state, self._dynamics.motion(state))

    def _keep(self, time: float, state: Array, motion: Motion) -> None:
        membranes = self._dynamics.membranes
        tension = np.tile(motion.tension, (membranes.copies, 1))
        self._frames.append(
            (time, membranes.curve_tangent_angle(state), membranes.curve_center(state), tension)
        )

    def _append(self, name: str, value: float) -> None:
        self.values.setdefault(name, []).append(value)

    def _frame_is_due(self, time: float) -> bool:
        if not self._frames:
            return True
        # Round-off in a multiple of the interval must not skip a frame.
        due, last = (np.floor(t / self._frame_interval + 1e-9) for t in (time, self._frames[-1][0]))
        return bool(due > last)

    @property
    def series(self) -> Series:
        """All diagnostics."""
        found = {name: np.array(values) for name, values in self.values.items()}
        if "vesicle_cluster" in self._vesicle_values:
            sizes = [cluster_sizes(labels) for labels in self._vesicle_values["vesicle_cluster"]]
            found["clusters"] = np.array([float(len(of_sample)) for of_sample in sizes])
            found["largest_cluster"] = np.array([float(of_sample.max()) for of_sample in sizes])
        return found

    @property
    def vesicle_series(self) -> VesicleSeries:
        """What was measured of every vesicle."""
        return {name: np.array(values) for name, values in self._vesicle_values.items()}

    @property
    def frames(self) -> Frames:
        """All recorded states."""
        time, tangent_angle, center, tension = zip(*self._frames, strict=True)
        points = self._dynamics.membranes.points
        return Frames(
            np.array(time),
            np.array([resampled_angle(angle, points) for angle in tangent_angle]),
            np.array(center),
            np.array([resampled(values, points) for values in tension]),
        )
