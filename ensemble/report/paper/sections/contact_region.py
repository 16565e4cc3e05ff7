"""The contact region of a doublet at equilibrium: the gap between the membranes, and the adhesive force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.analysis.run import Array, Run
from solver.motion.terms import dense_equation
from solver.simulation.resolution import with_points


@dataclass(frozen=True)
class ContactRegion:
    """The side of one vesicle that faces the other one, in a frame in which they lie side by side.

    Attributes
    ----------
    along : (n,)
        Positions along the contact region, ascending, 0 on the line of centers.
    gap : (n,)
        Twice the distance from the middle between both vesicles.
    pull : (n,)
        Adhesive force per length toward the other vesicle; negative where it repels.
    """

    along: Array
    gap: Array
    pull: Array

    @property
    def edge(self) -> float:
        """Distance from the line of centers at which the gap is smallest."""
        return float(abs(self.along[np.argmin(self.gap)]))

    @property
    def dip(self) -> float:
        """Relative difference of the gap on the line of centers and the smallest gap."""
        return float(1 - self.gap.min() / self.middle_gap)

    @property
    def middle_gap(self) -> float:
        """Gap on the line of centers."""
        return float(np.interp(0.0, self.along, self.gap))

    @property
    def pull_at_edge(self) -> float:
        """Adhesive force per length at the edge."""
        return float(self.pull[np.argmin(self.gap)])

    @property
    def pull_in_middle(self) -> float:
        """Adhesive force per length on the line of centers."""
        return float(np.interp(0.0, self.along, self.pull))


def contact_region(run: Run) -> ContactRegion:
    """Return the contact region in the last frame of a run.

    Parameters
    ----------
    run : Run
        A run of two equal vesicles with adhesion.

    Returns
    -------
    ContactRegion
    """
    frames = run.frames
    points = frames.tangent_angle.shape[-1]
    equation = dense_equation(with_points(run.scene, points))
    membranes = equation.membranes
    computed = slice(membranes.count)  # the others are images
    motion = equation.motion(membranes.pack(frames.tangent_angle[-1, computed], frames.center[-1, computed]))
    assert motion.adhesion is not None
    first, second = frames.center[-1]
    toward = (second - first) / np.linalg.norm(second - first)
    sideways = np.array([-toward[1], toward[0]])
    offset = motion.geometry.points[:, 0] - (first + second)[:, None] / 2
    along, distance = sideways @ offset, -(toward @ offset)
    facing = distance < toward @ (second - first) / 2  # nearer to the other vesicle than the own center is
    order = np.argsort(along[facing])
    pull = toward @ motion.adhesion[:, 0]
    return ContactRegion(along[facing][order], 2 * distance[facing][order], pull[facing][order])
