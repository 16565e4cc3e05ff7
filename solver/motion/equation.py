"""The equation of motion, as recording, criteria and integrators see it.

The membranes move with the fluid and do not stretch (Quaife et al. 2019, eq. 1).  The unknowns, the state,
are the tangent angle θ at the points of each vesicle and the vesicle's center c:

    θ_t = n · u_s,    c_t = mean(u).

Where steps are not chosen by the drift of areas, a term is added that vanishes on the exact motion and leads
areas and closures back (`solver.membrane.restoring`).

An equation may keep what its last evaluation found, to make the next one cheaper: an inverse that
preconditions the search for the tension, or the tension with which that search begins.  Such a memory decides
the last bits of what is computed.  So only `rate` and `jacobian`, which steps ask for, change it; `motion`,
which recording asks for, reads it and leaves it as it is.  What is recorded never changes what is computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.products import multiply
from solver.membrane.spectral import differentiation, highest_modes
from solver.membrane.tangential_velocity import add_tangential_motion

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.forces.bending import Bending
    from solver.membrane.geometry import Geometry, Membranes
    from solver.memory import Saved
    from solver.motion.jacobian import Jacobian
    from solver.potentials.proximity import Proximity
    from solver.potentials.viscosity_contrast import ViscosityContrast
    from solver.scene import Numerics

Array = NDArray[np.float64]


def accuracy_of(numerics: Numerics) -> float:
    """Return the relative error allowed in sums and iterations.

    It is so far below the tolerance of the time integrator that it does not limit its steps.

    Parameters
    ----------
    numerics : Numerics
        Of the scene.

    Returns
    -------
    float
        A thousandth of the tolerance, but at least 1e-12 and at most 1e-7.
    """
    return float(np.clip(1e-3 * numerics.tolerance, 1e-12, 1e-7))


@dataclass(frozen=True)
class Motion:
    """Velocity, tension and forces in one state of M vesicles with N points each.

    Attributes
    ----------
    geometry : Geometry
        Points and tangents in this state.
    closeness : Proximity or None
        Which membranes are close to which; None for a single curve.
    velocity : (2, M, N)
        u at the points.
    rotation_rate : (M, N)
        n · u_s, how fast the material turns.
    tension : (M, N)
    bending : (2, M, N)
        Force per length.
    adhesion : (2, M, N) or None
        Force per length; None for a scene without adhesion.
    restoring : (M, N) or None
        What is added to the rates of the tangent angles to restore areas and closures; None where nothing is.
    """

    geometry: Geometry
    closeness: Proximity | None
    velocity: Array
    rotation_rate: Array
    tension: Array
    bending: Array
    adhesion: Array | None
    restoring: Array | None

    @cached_property
    def rate(self) -> Array:
        """Rate of change of the state, (state_size,)."""
        rate = np.empty(self.rotation_rate.size + 2 * len(self.rotation_rate))
        highest = highest_modes(self.rotation_rate.shape[1])
        _write_rate(self.geometry.curvature, self.rotation_rate, self.velocity, highest, rate)
        if self.restoring is not None:
            rate[: self.restoring.size] += self.restoring.ravel()
        return rate


@compiled
def _write_rate(curvature: Array, rotation_rate: Array, velocity: Array, held: Array, rate: Array) -> None:
    """Write the rate of change of the state, without what restores areas and closures.

    The two highest modes of the tangent angle stay as they are: their tangents alias onto a mode whose
    derivative vanishes, so that bending does not damp them, and the tangential velocity of the points would
    slowly fill them.
    """
    count, points = rotation_rate.shape
    for vesicle in range(count):
        own = rate[vesicle * points : (vesicle + 1) * points]
        for j in range(points):
            own[j] = rotation_rate[vesicle, j]
        add_tangential_motion(curvature[vesicle], own, held)
        for component in range(2):
            rate[count * (points + component) + vesicle] = velocity[component, vesicle].mean()


_FIELDS = ("velocity", "rotation_rate", "tension", "bending", "adhesion", "restoring")


def flow_rate(flow: ImposedFlow | None) -> float:
    """Return the rate of a flow, 0 without one: two evaluations differ in nothing else but their states.

    Parameters
    ----------
    flow : ImposedFlow or None

    Returns
    -------
    float
    """
    return flow.rate if flow else 0.0


def saved_motion(state: Array, motion: Motion) -> Saved:
    """Return a motion as plain values (`solver.memory`).

    Parameters
    ----------
    state : (state_size,)
    motion : Motion
        In this state.

    Returns
    -------
    dict
    """
    return {"state": state, **{name: getattr(motion, name) for name in _FIELDS}}


def restored_motion(saved: Saved, geometry: Geometry, closeness: Proximity | None) -> Motion:
    """Return a motion that was saved.

    Parameters
    ----------
    saved : dict
        As `saved_motion` returned it.
    geometry : Geometry
        Of its state.
    closeness : Proximity or None
        Of the geometry.

    Returns
    -------
    Motion
    """
    return Motion(geometry, closeness, **{name: saved[name] for name in _FIELDS})


class AdhesionEnergy(Protocol):
    """What recording asks of the adhesion between vesicles."""

    def energy(self, geometry: Geometry, closeness: Proximity) -> float:
        """Return the adhesion energy of all pairs of vesicles.

        Parameters
        ----------
        geometry : Geometry
        closeness : Proximity
            Of this geometry.

        Returns
        -------
        float
        """

    def sum_error(self, closeness: Proximity) -> float:
        """Return the relative error of the force between the closest membranes.

        Parameters
        ----------
        closeness : Proximity

        Returns
        -------
        float
        """


class EquationOfMotion(Protocol):
    """How tangent angles and centers change.

    The two forms are `DenseEquation` and `SummedEquation`; `TimedEquation` is either of them with a rate of
    flow that changes with time.
    """

    @property
    def evaluations(self) -> int:
        """How often velocity, tension and forces were computed for `rate` and `jacobian`."""

    @property
    def recordings(self) -> int:
        """How often they were computed for `motion`, because no step had done so."""

    @property
    def membranes(self) -> Membranes:
        """What stays the same during a run."""

    @property
    def bending(self) -> Bending:
        """The bending forces."""

    @property
    def adhesion(self) -> AdhesionEnergy | None:
        """The adhesion between vesicles; None for a scene without."""

    @property
    def contrast(self) -> ViscosityContrast | None:
        """What other viscosities inside the vesicles change; None if all are that of the fluid outside."""

    @property
    def tension_iterations(self) -> int:
        """Number of iterations of the search for the tension so far, of steps and recordings together."""

    def motion(self, state: Array) -> Motion:
        """Compute velocity, tension and forces in a state, without any effect on later calls.

        In a state that a step has just evaluated they are known.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        Motion

        Raises
        ------
        TensionNotFoundError
            If the membranes are too distorted.
        """

    def rate(self, state: Array) -> Array:
        """Compute d(state)/dt for a step.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (state_size,)
            See `Motion.rate`.

        Raises
        ------
        TensionNotFoundError
            If the membranes are too distorted.
        """

    def jacobian(self, state: Array) -> Jacobian:
        """Compute the derivative of `rate` by the state, for a step.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        Jacobian
            Exact or close to it, as the form of the equation says.

        Raises
        ------
        TensionNotFoundError
            If the membranes are too distorted.
        """

    def restored_jacobian(self, saved: Saved) -> Jacobian:
        """Return a Jacobian that `jacobian` once returned.

        Parameters
        ----------
        saved : dict
            As `Jacobian.saved` returned it.

        Returns
        -------
        Jacobian
        """

    def saved(self) -> Saved:
        """Return what was kept for the next evaluations, and the counts, as plain values.

        Returns
        -------
        dict
        """

    def restore(self, saved: Saved) -> None:
        """Go on where another equation of the same scene was.

        Parameters
        ----------
        saved : dict
        """

    def symmetries(self, state: Array) -> Array:
        """Return directions in which every motion may be moved and stays one.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (M, state_size)
            See `point_shifts`.
        """

    def conserved(self, state: Array) -> Array:
        """Return quantities of order 1 that the exact motion keeps.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (3·M,)
            See `conserved_quantities`.
        """


def point_shifts(membranes: Membranes, state: Array) -> Array:
    """Return what a shift of each vesicle's points along its membrane changes: nothing else than names.

    Parameters
    ----------
    membranes : Membranes
    state : (state_size,)

    Returns
    -------
    (M, state_size)
        Derivatives by the shift, in units of length/2π.
    """
    shifts = np.zeros((membranes.count, membranes.state_size))
    _write_shifts(membranes.tangent_angle(state), differentiation(membranes.points), shifts)
    return shifts


@compiled
def _write_shifts(tangent_angle: Array, derivative: Array, shifts: Array) -> None:
    """Write `point_shifts`: 1 plus the derivative of what is periodic in the tangent angles."""
    count, points = tangent_angle.shape
    periodic = np.empty(points)
    for vesicle in range(count):
        for j in range(points):
            periodic[j] = tangent_angle[vesicle, j] - 2.0 * np.pi * j / points
        own = shifts[vesicle, vesicle * points : (vesicle + 1) * points]
        multiply(derivative, periodic, own)
        for j in range(points):
            own[j] += 1.0


def conserved_quantities(geometry: Geometry) -> Array:
    """Return the reduced area of each vesicle, and how far each curve is from closing, over its length.

    Parameters
    ----------
    geometry : Geometry
        Of M vesicles.

    Returns
    -------
    (3·M,)
        Reduced areas 4π·area/length², then the mean tangents, x and y.
    """
    reduced_areas = 4 * np.pi * geometry.areas / geometry.membranes.length**2
    return np.concatenate([reduced_areas, geometry.tangents.mean(axis=2).ravel()])
