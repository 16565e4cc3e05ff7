"""The equation of motion of many vesicles; see `solver.motion.dense`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from solver.flows import ImposedFlow
from solver.forces.bending import Bending
from solver.forces.summed_adhesion import SummedAdhesion
from solver.forces.summed_tension import Preconditioner, SummedInextensibility
from solver.forces.tension import Inextensibility, TensionNotFoundError
from solver.forces.truncated_adhesion import TruncatedAdhesion
from solver.membrane.geometry import Geometry, Membranes
from solver.motion.block_diagonal import BlockDiagonal
from solver.motion.dense import DenseEquation, Motion, accuracy_of, state_change
from solver.parallel import Parallel, Shares
from solver.potentials.neighbors import Neighbors
from solver.potentials.summed_single_layer import SummedSingleLayer
from solver.scene import Adhesion as AdhesionParameters
from solver.scene import Scene

Array = NDArray[np.float64]


def _adhesion(
    parameters: AdhesionParameters | None, accuracy: float, membranes: Membranes, parallel: Parallel
) -> SummedAdhesion | TruncatedAdhesion | None:
    """The adhesion that many vesicles have."""
    if parameters is None:
        return None
    if parameters.cutoff is not None:
        return TruncatedAdhesion(parameters, accuracy, membranes, parallel)
    return SummedAdhesion(parameters, accuracy, parallel)


@dataclass
class SummedEquation:
    """Right-hand side of the equation of motion, and its Jacobian without what vesicles do to each other.

    ``adhesion`` and ``flow`` are None for a scene without.
    """

    scene: Scene
    parallel: Parallel
    membranes: Membranes
    bending: Bending
    adhesion: SummedAdhesion | TruncatedAdhesion | None
    flow: ImposedFlow | None
    inextensibility: SummedInextensibility
    layer: SummedSingleLayer
    evaluations: int = field(default=0, init=False)
    _preconditioner: Preconditioner | None = field(default=None, init=False)
    _last: Motion | None = field(default=None, init=False)

    @classmethod
    def of(cls, scene: Scene, parallel: Parallel) -> Self:
        """The terms of a scene, computed together by these ranks."""
        membranes = Membranes.of_scene(scene)
        accuracy = accuracy_of(scene.numerics)
        return cls(
            scene=scene,
            parallel=parallel,
            membranes=membranes,
            bending=Bending(),
            adhesion=_adhesion(scene.adhesion, accuracy, membranes, parallel),
            flow=scene.flow,
            inextensibility=SummedInextensibility(accuracy),
            layer=SummedSingleLayer(membranes, accuracy, parallel),
        )

    @property
    def reach(self) -> float:
        """Distance over spacing within which a term sees the points of a vesicle refined."""
        return max(self.layer.ratio, self.adhesion.reach if self.adhesion else 0.0)

    def motion(self, state: Array) -> Motion:
        """Velocity, tension and forces in a state."""
        self.evaluations += 1
        geometry = Geometry(self.membranes, state)
        neighbors = Neighbors(geometry, self.reach)
        self.layer.assemble(geometry, neighbors)
        if self._preconditioner is None:
            self._preconditioner = self._precondition(
                geometry,
                self.parallel.divide(self.membranes.count),
                lambda alone, own, _: alone.inextensibility.factorize(alone.layer, own),
            )
        bending = self.bending.density(geometry)
        density, adhesion = bending, None
        if self.adhesion:
            adhesion = self.adhesion.density(geometry, neighbors)
            density = bending + adhesion
        free = self.inextensibility.solve(
            self.layer,
            geometry,
            self._preconditioner,
            density,
            self.flow.velocity(geometry.points, geometry.centers) if self.flow else None,
        )
        self._last = Motion(
            geometry, neighbors, free.velocity, free.rotation_rate, free.tension, bending, adhesion
        )
        return self._last

    def rate(self, state: Array) -> Array:
        """d(state)/dt; see `DenseEquation.rate`."""
        return state_change(self.motion(state))

    def rate_of(self, motion: Motion) -> Array:
        """`rate` in the state of a motion."""
        return state_change(motion)

    def jacobian(self, state: Array) -> BlockDiagonal:
        """Each vesicle's part of `rate` by its own part of the state, while the others rest.

        It is that of the last state whose motion was found: an implicit step asks for it close to that one.
        """
        motion = self._last or self.motion(state)
        assert motion.closeness is not None
        count, points = self.membranes.count, self.membranes.points
        stiffness = self.adhesion.stiffness(motion.geometry, motion.closeness) if self.adhesion else None
        shares = self.parallel.divide(count)
        own = range(count)[shares.own]
        blocks = np.empty((len(own), points + 2, points + 2))

        def linearize(alone: DenseEquation, geometry: Geometry, k: int) -> None:
            part = slice(own[k], own[k] + 1)
            among_others = Motion(
                geometry,
                None,
                motion.velocity[:, part],
                motion.rotation_rate[part],
                motion.tension[part],
                motion.bending[:, part],
                None if motion.adhesion is None else motion.adhesion[:, part],
            )
            by_state = alone.point_derivatives(geometry)
            drawn = None if stiffness is None else _drawn(stiffness[:, own[k]], by_state)
            blocks[k] = alone.linearized(among_others, drawn)

        self._preconditioner = self._precondition(motion.geometry, shares, linearize)
        angles = np.arange(count * points).reshape(count, points)
        centers = count * points + np.arange(2 * count).reshape(2, count).T
        return BlockDiagonal(blocks, np.concatenate([angles, centers], axis=1), shares)

    def _precondition(
        self, geometry: Geometry, shares: Shares, factorize: Callable[[DenseEquation, Geometry, int], object]
    ) -> Preconditioner:
        """The preconditioner for the tension, after this rank's vesicles have been factorized one by one.

        Collective, and so is a failure: where one rank's has one, all raise it.
        """
        count, points = self.membranes.count, self.membranes.points
        own = range(count)[shares.own]
        inverses, shifts = np.empty((len(own), points, points)), np.empty(len(own))
        failed = np.zeros(len(own))
        for k, vesicle in enumerate(own):
            alone, its_geometry = self._alone(geometry, vesicle)
            try:
                factorize(alone, its_geometry, k)
            except TensionNotFoundError:
                failed[k] = 1.0
                continue
            inverses[k], shifts[k] = alone.inextensibility.inverse, alone.inextensibility.shift
        if (everywhere := shares.gather(failed)).any():
            vesicle = int(np.argmax(everywhere))
            raise TensionNotFoundError(f"the tension could not be found: vesicle {vesicle} is too distorted")
        return Preconditioner(shares.gather(inverses), shares.gather(shifts)[:, None])

    def _alone(self, geometry: Geometry, vesicle: int) -> tuple[DenseEquation, Geometry]:
        """A vesicle as if it were alone in the flow, its single layer assembled."""
        scene = self.scene.model_copy(update={"vesicles": (self.scene.vesicles[vesicle],), "adhesion": None})
        accuracy = accuracy_of(scene.numerics)
        alone = replace(DenseEquation.of(scene), inextensibility=Inextensibility(accuracy, 1e-3 * accuracy))
        state = np.concatenate([geometry.tangent_angle[vesicle], geometry.centers[:, vesicle]])
        own = Geometry(alone.membranes, state)
        alone.layer.assemble(own, None)
        return alone, own


def _drawn(stiffness: Array, by_state: Array) -> Array:
    """Derivatives of the force on each point by the state, (2, N, state), from those by the point, (3, N)."""
    xx, xy, yy = stiffness[:, :, None]
    x, y = by_state
    return np.stack([xx * x + xy * y, xy * x + yy * y])
