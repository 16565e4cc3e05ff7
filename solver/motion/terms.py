"""From a scene to its equation of motion.

This is the one place where a scene becomes the terms that it has, in one of two forms: with matrices over all
points, or with sums.  What a scene does not have is never constructed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.forces.adhesion import DirectAdhesion
from solver.forces.bending import bending_of
from solver.forces.coarsened_adhesion import adhesion_of_many
from solver.forces.summed_tension import SummedInextensibility
from solver.forces.tension import ROUND_OFF, Inextensibility
from solver.membrane.geometry import Membranes
from solver.membrane.restoring import Restoring
from solver.membrane.symmetry import independent_vesicles
from solver.motion.dense import DenseEquation
from solver.motion.equation import EquationOfMotion, accuracy_of
from solver.motion.summed import SummedEquation
from solver.motion.timed import TimedEquation
from solver.parallel import SERIAL, Parallel
from solver.potentials.single_layer import SingleLayer
from solver.potentials.summed_single_layer import SummedSingleLayer
from solver.potentials.viscosity_contrast import ViscosityContrast, contrasts

if TYPE_CHECKING:
    from solver.scene import Scene, Vesicle

MOST_ACCURATE = 1e-9  # tolerance below which `accuracy_of` does not improve


def equation_of_motion(scene: Scene, parallel: Parallel = SERIAL, time: float = 0.0) -> EquationOfMotion:
    """Make the equation of motion of a scene, in the form that serves it better.

    Parameters
    ----------
    scene : Scene
        Its number of points is given.
    parallel : Parallel
        The ranks that compute the run together.
    time : float
        When the steps begin.

    Returns
    -------
    EquationOfMotion
        Of states with a clock if the scene has a protocol (`solver.motion.timed`).
    """
    equation = summed_equation(scene, parallel) if scene.many else dense_equation(scene, parallel)
    if scene.protocol is None or scene.flow is None:
        return equation
    return TimedEquation(equation, scene.flow, scene.protocol, time)


def dense_equation(scene: Scene, parallel: Parallel = SERIAL) -> DenseEquation:
    """Make the equation of motion with matrices over all points.

    Parameters
    ----------
    scene : Scene
        Its number of points is given.
    parallel : Parallel
        The ranks that compute the terms together.

    Returns
    -------
    DenseEquation
    """
    return dense_equation_of(independent_vesicles(scene), scene, parallel)


def dense_equation_of(
    vesicles: tuple[Vesicle, ...], scene: Scene, parallel: Parallel = SERIAL
) -> DenseEquation:
    """Make the equation of motion, with matrices, in which some of a scene's vesicles are computed.

    Parameters
    ----------
    vesicles : tuple of Vesicle
        All of the scene, or those of which the others are images.
    scene : Scene
        Its number of points is given.
    parallel : Parallel
        The ranks that compute the terms together.

    Returns
    -------
    DenseEquation
    """
    membranes = Membranes.of_some(vesicles, scene)
    adhesion = None
    several = membranes.curves > 1
    accuracy = accuracy_of(scene.numerics)
    contrast = contrasts(vesicles)
    differ = bool(np.any(contrast != 1))
    if scene.adhesion and several:
        adhesion = DirectAdhesion(scene.adhesion, accuracy, membranes, parallel)
    return DenseEquation(
        membranes=membranes,
        bending=bending_of(membranes),
        adhesion=adhesion,
        flow=scene.flow,
        inextensibility=Inextensibility(accuracy, 1e-3 * accuracy if several else ROUND_OFF),
        layer=SingleLayer(membranes, accuracy, parallel),
        contrast=ViscosityContrast(contrast, membranes, accuracy) if differ else None,
        restoring=_restoring(vesicles, scene),
    )


def accurate_equation(vesicles: tuple[Vesicle, ...], scene: Scene) -> DenseEquation:
    """Make the equation of motion, with matrices, as accurate as it can be whatever the scene's tolerance.

    Parameters
    ----------
    vesicles : tuple of Vesicle
        See `dense_equation_of`.
    scene : Scene
        Its number of points is given.

    Returns
    -------
    DenseEquation
    """
    numerics = scene.numerics.model_copy(update={"tolerance": MOST_ACCURATE})
    return dense_equation_of(vesicles, scene.model_copy(update={"numerics": numerics}))


def summed_equation(scene: Scene, parallel: Parallel = SERIAL) -> SummedEquation:
    """Make the equation of motion with sums.

    Parameters
    ----------
    scene : Scene
        Its number of points is given, and it has no viscosity contrast.
    parallel : Parallel
        The ranks that compute the terms together.

    Returns
    -------
    SummedEquation
    """
    membranes = Membranes.of_scene(scene)
    accuracy = accuracy_of(scene.numerics)
    adhesion = None
    if scene.adhesion:
        adhesion = adhesion_of_many(scene.adhesion, accuracy, membranes, parallel)

    restoring = _restoring(scene.vesicles, scene)

    def isolated(vesicle: int) -> DenseEquation:
        alone = scene.model_copy(update={"vesicles": (scene.vesicles[vesicle],), "adhesion": None})
        return replace(
            dense_equation(alone),
            # The others count as well: what their sums leave over must not be divided by round-off.
            inextensibility=Inextensibility(accuracy, 1e-3 * accuracy),
            restoring=restoring.of_vesicle(vesicle) if restoring else None,
        )

    return SummedEquation(
        parallel=parallel,
        membranes=membranes,
        bending=bending_of(membranes),
        adhesion=adhesion,
        flow=scene.flow,
        inextensibility=SummedInextensibility(accuracy),
        layer=SummedSingleLayer(membranes, accuracy, parallel),
        isolated=isolated,
        restoring=restoring,
    )


def _restoring(vesicles: tuple[Vesicle, ...], scene: Scene) -> Restoring | None:
    """Return what restores areas and closures; nothing may where their drift is what chooses the steps."""
    return None if scene.numerics.step_control == "area-length" else Restoring.of_some(vesicles, scene)
