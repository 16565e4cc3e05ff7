"""The equation of motion of many vesicles, with sums instead of matrices over all points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.forces.summed_tension import Preconditioner, SummedInextensibility
from solver.forces.tension import TensionInverse, TensionNotFoundError
from solver.membrane.geometry import Geometry, Membranes
from solver.motion.equation import (
    Motion,
    conserved_quantities,
    flow_rate,
    point_shifts,
    restored_motion,
    saved_motion,
)
from solver.motion.jacobian import BlockDiagonal
from solver.potentials.neighbors import Neighbors

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.forces.adhesion import DirectAdhesion
    from solver.forces.bending import Bending
    from solver.forces.coarsened_adhesion import CoarsenedAdhesion
    from solver.membrane.restoring import Restoring
    from solver.memory import Saved
    from solver.motion.dense import DenseEquation
    from solver.parallel import Parallel, Shares
    from solver.potentials.summed_single_layer import SummedSingleLayer

Array = NDArray[np.float64]


class _Evaluation(NamedTuple):
    """A state, the rate of its flow, the motion, and the preconditioner that served to find its tension."""

    state: Array
    flow_rate: float
    motion: Motion
    preconditioner: Preconditioner


@dataclass
class SummedEquation:
    """The equation of motion, with a Jacobian without what vesicles do to each other.

    See `EquationOfMotion`.

    Attributes
    ----------
    parallel : Parallel
        The ranks that compute the terms together.
    membranes : Membranes
    bending : Bending
    adhesion : CoarsenedAdhesion or DirectAdhesion or None
        None for a scene without.
    flow : ImposedFlow or None
        None in a quiescent fluid.
    inextensibility : SummedInextensibility
    layer : SummedSingleLayer
    isolated : callable
        From the number of a vesicle to its `DenseEquation` as if it were alone in the flow.
    contrast : None
        Sums know no other viscosity inside the vesicles.
    restoring : Restoring or None
        None where steps are chosen by the drift of areas.
    evaluations, recordings : int
        See `EquationOfMotion`.
    """

    parallel: Parallel
    membranes: Membranes
    bending: Bending
    adhesion: CoarsenedAdhesion | DirectAdhesion | None
    flow: ImposedFlow | None
    inextensibility: SummedInextensibility
    layer: SummedSingleLayer
    isolated: Callable[[int], DenseEquation]
    contrast: None = field(default=None, init=False)
    restoring: Restoring | None = None
    evaluations: int = field(default=0, init=False)
    recordings: int = field(default=0, init=False)
    _last: _Evaluation | None = field(default=None, init=False)

    @property
    def reach(self) -> float:
        """Distance over spacing within which a term needs the points of a vesicle refined."""
        return max(self.layer.ratio, self.adhesion.reach if self.adhesion else 0.0)

    @property
    def tension_iterations(self) -> int:
        """Number of iterations of the search for the tension so far."""
        return self.inextensibility.iterations

    def motion(self, state: Array) -> Motion:
        """Compute velocity, tension and forces in a state; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        Motion
        """
        if self._last and self._is_of(self._last, state):
            return self._last.motion
        self.recordings += 1
        return self._evaluate(state).motion

    def rate(self, state: Array) -> Array:
        """Compute d(state)/dt for a step; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (state_size,)
        """
        self.evaluations += 1
        self._last = self._evaluate(state)
        return self._last.motion.rate

    def jacobian(self, state: Array) -> BlockDiagonal:
        """Compute the derivative of each vesicle's `rate` by its own part of the state, the others at rest.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        BlockDiagonal
        """
        if self._last is None or not self._is_of(self._last, state):
            self.evaluations += 1
            self._last = self._evaluate(state)
        motion = self._last.motion
        assert motion.closeness is not None
        count, points = self.membranes.count, self.membranes.points
        stiffness = self.adhesion.stiffness(motion.geometry, motion.closeness) if self.adhesion else None
        shares = self.parallel.divide(count)
        mine = range(count)[shares.own]
        blocks = np.empty((len(mine), points + 2, points + 2))

        def linearize(isolated: DenseEquation, geometry: Geometry, vesicle: int) -> TensionInverse:
            adhesion = None
            if stiffness is not None:
                adhesion = _by_state(stiffness[:, vesicle], isolated.point_derivatives(geometry))
            part = _part(motion, geometry, vesicle)
            blocks[vesicle - shares.own.start], inverse = isolated.linearize(part, adhesion)
            return inverse

        self._last = self._last._replace(
            preconditioner=self._precondition(motion.geometry, shares, linearize)
        )
        return BlockDiagonal(blocks, self._members, shares)

    @property
    def _members(self) -> NDArray[np.int64]:
        """The elements of the state that belong to each vesicle, (M, N + 2)."""
        count, points = self.membranes.count, self.membranes.points
        angles = np.arange(count * points).reshape(count, points)
        centers = count * points + np.arange(2 * count).reshape(2, count).T
        return np.concatenate([angles, centers], axis=1)

    def restored_jacobian(self, saved: Saved) -> BlockDiagonal:
        """Return a Jacobian that `jacobian` once returned; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict

        Returns
        -------
        BlockDiagonal
        """
        shares = self.parallel.divide(self.membranes.count)
        return BlockDiagonal(saved["blocks"][shares.own], self._members, shares)

    def saved(self) -> Saved:
        """Return what was kept for the next evaluations; see `EquationOfMotion`.

        Returns
        -------
        dict
        """
        last = self._last
        return {
            "evaluations": self.evaluations,
            "recordings": self.recordings,
            "tension_iterations": self.inextensibility.iterations,
            "last": saved_motion(last.state, last.motion) | {"flow_rate": last.flow_rate} if last else None,
            "preconditioner": tuple(last.preconditioner) if last else None,
        }

    def restore(self, saved: Saved) -> None:
        """Go on where another equation was; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict
        """
        self.evaluations, self.recordings = saved["evaluations"], saved["recordings"]
        self.inextensibility.iterations = saved["tension_iterations"]
        self._last = None
        if saved["last"]:
            geometry = Geometry(self.membranes, saved["last"]["state"])
            motion = restored_motion(saved["last"], geometry, Neighbors(geometry, self.reach))
            preconditioner = Preconditioner(*saved["preconditioner"])
            state, rate = saved["last"]["state"], saved["last"]["flow_rate"]
            self._last = _Evaluation(state, rate, motion, preconditioner)

    def symmetries(self, state: Array) -> Array:
        """Return directions in which every motion may be moved; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (M, state_size)
        """
        return point_shifts(self.membranes, state)

    def conserved(self, state: Array) -> Array:
        """Return quantities of order 1 that the exact motion keeps; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size,)

        Returns
        -------
        (3·M,)
        """
        return conserved_quantities(Geometry(self.membranes, state))

    def _evaluate(self, state: Array) -> _Evaluation:
        """Compute the motion in a state, with what the last evaluation for a step left."""
        state = state.copy()  # the integrator may go on in its own array, and the evaluation is kept
        geometry = Geometry(self.membranes, state)
        neighbors = Neighbors(geometry, self.reach)
        self.layer.assemble(geometry, neighbors)
        if self._last:
            preconditioner, guess = self._last.preconditioner, self._last.motion.tension
        else:
            shares = self.parallel.divide(self.membranes.count)
            preconditioner, guess = self._precondition(geometry, shares, _tension_inverse), None
        bending = self.bending.density(geometry)
        density, adhesion = bending, None
        if self.adhesion:
            adhesion = self.adhesion.density(geometry, neighbors)
            density = bending + adhesion
        flow = self.flow.velocity(geometry.points, geometry.centers) if self.flow else None
        free = self.inextensibility.solve(self.layer, geometry, preconditioner, density, flow, guess)
        restoring = self.restoring.rate(geometry) if self.restoring else None
        motion = Motion(
            geometry, neighbors, free.velocity, free.rotation_rate, free.tension, bending, adhesion, restoring
        )
        return _Evaluation(state, flow_rate(self.flow), motion, preconditioner)

    def _is_of(self, evaluation: _Evaluation, state: Array) -> bool:
        """Return whether an evaluation was made in a state, with the present flow."""
        return evaluation.flow_rate == flow_rate(self.flow) and np.array_equal(evaluation.state, state)

    def _precondition(
        self,
        geometry: Geometry,
        shares: Shares,
        invert: Callable[[DenseEquation, Geometry, int], TensionInverse],
    ) -> Preconditioner:
        """Make the preconditioner for the tension from what ``invert`` returns of this rank's vesicles.

        ``invert`` is given a vesicle as if it were alone, its geometry and its number.  Collective, and so is
        a failure: where one rank's ``invert`` fails, all raise the error.
        """
        count, points = self.membranes.count, self.membranes.points
        mine = range(count)[shares.own]
        inverses, shifts = np.empty((len(mine), points, points)), np.empty(len(mine))
        failed = np.zeros(len(mine))
        for k, vesicle in enumerate(mine):
            isolated = self.isolated(vesicle)
            isolated.flow = self.flow
            state = np.concatenate([geometry.tangent_angle[vesicle], geometry.centers[:, vesicle]])
            its_geometry = Geometry(isolated.membranes, state)
            try:
                inverses[k], shifts[k : k + 1] = invert(isolated, its_geometry, vesicle)
            except TensionNotFoundError:
                failed[k] = 1.0
        if (everywhere := shares.gather(failed)).any():
            vesicle = int(np.argmax(everywhere))
            raise TensionNotFoundError(f"the tension could not be found: vesicle {vesicle} is too distorted")
        return Preconditioner(shares.gather(inverses), shares.gather(shifts)[:, None])


def _tension_inverse(isolated: DenseEquation, geometry: Geometry, _: int) -> TensionInverse:
    return isolated.tension_inverse(geometry)


def _part(motion: Motion, geometry: Geometry, vesicle: int) -> Motion:
    """Return one vesicle's part of the motion of many."""
    part = slice(vesicle, vesicle + 1)
    return Motion(
        geometry,
        None,
        motion.velocity[:, part],
        motion.rotation_rate[part],
        motion.tension[part],
        motion.bending[:, part],
        None if motion.adhesion is None else motion.adhesion[:, part],
        None if motion.restoring is None else motion.restoring[part],
    )


def _by_state(stiffness: Array, by_state: Array) -> Array:
    """Return derivatives by the state, (2, N, state), from those of forces by their own point, (3, N)."""
    xx, xy, yy = stiffness[:, :, None]
    x, y = by_state
    return np.stack([xx * x + xy * y, xy * x + yy * y])
