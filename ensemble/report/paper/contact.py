"""The contact region of a doublet at equilibrium: how far apart the membranes are, and what pulls them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.analysis.run import Array, Run
from solver.motion.dense import DenseEquation
from solver.simulation.resolution import with_points


@dataclass(frozen=True)
class Contact:
    """The side of one vesicle that faces the other, in a frame in which they lie side by side.

    along : (n,), along the contact region, ascending, 0 on the line of centers.
    gap : (n,), twice the distance to the middle between the two.
    pull : (n,), adhesive force per length toward the other vesicle; negative where it repels.
    """

    along: Array
    gap: Array
    pull: Array

    @property
    def edge(self) -> float:
        """How far from the line of centers the gap is smallest."""
        return float(abs(self.along[np.argmin(self.gap)]))

    @property
    def dip(self) -> float:
        """How much smaller the gap is there than on the line of centers, over the latter."""
        return float(1 - self.gap.min() / self.middle_gap)

    @property
    def middle_gap(self) -> float:
        """Gap on the line of centers."""
        return float(np.interp(0.0, self.along, self.gap))

    @property
    def attracted(self) -> float:
        """Share of the contact region, between its two edges, on which the other vesicle attracts."""
        between = np.abs(self.along) <= self.edge
        weight = np.gradient(self.along)
        return float(weight[between & (self.pull > 0)].sum() / weight[between].sum())

    @property
    def pull_at_edge(self) -> float:
        """Adhesive force per length at the edge."""
        return float(self.pull[np.argmin(self.gap)])

    @property
    def pull_in_middle(self) -> float:
        """Adhesive force per length on the line of centers."""
        return float(np.interp(0.0, self.along, self.pull))


def contact_of(run: Run) -> Contact:
    """Measure the contact region in the last frame of a run of two equal vesicles with adhesion.

    Parameters
    ----------
    run : Run
    """
    frames = run.frames
    points = frames.tangent_angle.shape[-1]
    dynamics = DenseEquation.of(with_points(run.scene, points))
    membranes = dynamics.membranes
    computed = slice(membranes.count)  # the others are images
    motion = dynamics.motion(membranes.pack(frames.tangent_angle[-1, computed], frames.center[-1, computed]))
    assert motion.adhesion is not None
    first, second = frames.center[-1]
    toward = (second - first) / np.linalg.norm(second - first)
    sideways = np.array([-toward[1], toward[0]])
    offset = motion.geometry.points[:, 0] - (first + second)[:, None] / 2
    along, distance = sideways @ offset, -(toward @ offset)
    facing = distance < toward @ (second - first) / 2  # nearer to the other than the vesicle's own center
    order = np.argsort(along[facing])
    pull = toward @ motion.adhesion[:, 0]
    return Contact(along[facing][order], 2 * distance[facing][order], pull[facing][order])
