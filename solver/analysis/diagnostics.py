"""What is measured in one state of a run; `solver.analysis.run.Series` names the results and their units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.contacts import CONTACT, clusters
from solver.analysis.rheology import adhesion_stress, membrane_stress
from solver.membrane import curve
from solver.potentials.neighbors import gap

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.motion.equation import EquationOfMotion, Motion
    from solver.scene import Scene, Vesicle

    Measure = Callable[[Motion], float]
    VesicleMeasure = Callable[[Motion], NDArray[np.float64]]

Array = NDArray[np.float64]

_LEAST_VESICLES = 3  # of which each is measured on its own


def measures(scene: Scene, equation: EquationOfMotion) -> dict[str, Measure]:
    """Return the diagnostics that a scene has.

    Parameters
    ----------
    scene : Scene
    equation : EquationOfMotion
        Of this scene.

    Returns
    -------
    dict
        By the name of the series, functions of the motion in a state.  What depends on a velocity, a tension
        or a closeness that the motion has not is NaN (`Recorder.record_geometry`).
    """
    target_area = _areas(scene.vesicles[: equation.membranes.count])  # the others are images
    measured: dict[str, Measure] = {
        "bending_energy": lambda motion: equation.bending.energy(motion.geometry),
        "area_error": lambda motion: float(np.max(np.abs(motion.geometry.areas / target_area - 1))),
        "closure_error": lambda motion: float(curve.closure(motion.geometry.tangents.swapaxes(0, 1)).max()),
    }
    if equation.adhesion:
        energy = equation.adhesion.energy
        measured["adhesion_energy"] = lambda motion: (
            energy(motion.geometry, motion.closeness) if motion.closeness else np.nan
        )
    if len(scene.vesicles) > 1:
        measured["gap"] = lambda motion: gap(motion.geometry)
    else:
        measured["inclination_angle"] = lambda motion: float(curve.inclination(motion.geometry.points[:, 0]))
    return measured | viscosity_measures(scene, equation)


def viscosity_measures(scene: Scene, equation: EquationOfMotion) -> dict[str, Measure]:
    """Return the parts of the intrinsic viscosity that a scene has: stresses over shear rate and area.

    Parameters
    ----------
    scene : Scene
    equation : EquationOfMotion
        Of this scene.

    Returns
    -------
    dict
        As of `measures`; empty for flows without a viscosity.
    """
    shear_rate = scene.shear_rate
    if scene.flow is None or not shear_rate:
        return {}
    gradient = np.array(scene.flow.velocity_gradient(np.zeros(2)) / shear_rate)
    area = equation.membranes.multiplicity * _areas(scene.vesicles[: equation.membranes.count]).sum()
    scale = 1 / (shear_rate * area)
    parts: dict[str, Measure] = {
        "viscosity_bending_tension": lambda motion: scale * membrane_stress(motion, gradient)
    }
    if equation.adhesion:
        parts["viscosity_adhesion"] = lambda motion: scale * adhesion_stress(motion, gradient)
    if equation.contrast:
        added = equation.contrast.stress
        parts["viscosity_contrast"] = lambda motion: scale * added(motion.geometry, motion.velocity, gradient)
    return parts


def vesicle_measures(scene: Scene) -> dict[str, VesicleMeasure]:
    """Return the diagnostics of each vesicle that a scene of three or more has.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    dict
        By the name of the series, functions from the motion in a state to an array (vesicles, ...).
    """
    if len(scene.vesicles) < _LEAST_VESICLES:
        return {}
    target_area = _areas(scene.vesicles)
    measured: dict[str, VesicleMeasure] = {
        "vesicle_center": lambda motion: motion.geometry.centers.T,
        "vesicle_inclination_angle": lambda motion: curve.inclination(motion.geometry.points.swapaxes(0, 1)),
        "vesicle_area_error": lambda motion: motion.geometry.areas / target_area - 1,
    }
    if scene.adhesion:
        contact = CONTACT * scene.adhesion.distance
        measured["vesicle_cluster"] = lambda motion: clusters(motion.geometry, contact)
    return measured


def _areas(vesicles: tuple[Vesicle, ...]) -> Array:
    """Return the area of each vesicle that the scene asks for."""
    return np.array([v.reduced_area * v.length**2 / (4 * np.pi) for v in vesicles])
