"""How the time of one evaluation of a scene depends on the ranks that share it, and how many ranks pay off.

Ranks share the interactions of a point with its own vesicle and with near ones, and with groups of far ones
on each level of a tree.  Every rank repeats the rest that grows like the number of points (shapes, search for
neighbors, series about groups).  For each sum the ranks gather the rows of all.  With P points on G ranks

    t(G) = (level·P·log₂ P + point·P)/G + repeated·P + fixed
           + gathers·(latency·⌈log₂ G⌉ + bytes·P·(G − 1)/(G·bandwidth)),

where the latency of a collective grows like the depth of its tree (Thakur, Rabenseifner & Gropp 2005).
"""

from __future__ import annotations

import math
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from solver.membrane.symmetry import independent_vesicles
from solver.scene import Scene

_AUTOMATIC_POINTS = 64  # what a scene that leaves the number to the solver usually comes to

# The ranks of a run pay off as long as they are this efficient.
LEAST_EFFICIENCY: Final = 0.7


class ScalingModel(BaseModel):
    """The constants of the time of one evaluation.

    Attributes
    ----------
    level, point : float
        Seconds for each point and level of the tree, and for each point, that ranks share.
    repeated, fixed : float
        Seconds for each point, and for each evaluation, on every rank.
    gathers : float
        Collectives in an evaluation.
    bytes_a_point : float
        Bytes that each of them gathers for each point.
    latency : float
        Seconds of a collective between two ranks.
    bandwidth : float
        Bytes a second.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    level: float = Field(ge=0)
    point: float = Field(ge=0)
    repeated: float = Field(ge=0)
    fixed: float = Field(ge=0)
    gathers: float = Field(ge=0)
    bytes_a_point: float = Field(ge=0)
    latency: float = Field(ge=0)
    bandwidth: float = Field(gt=0)

    def seconds(self, points: float, ranks: int) -> float:
        """Return the seconds of an evaluation.

        Parameters
        ----------
        points : float
            In all.
        ranks : int

        Returns
        -------
        float
        """
        return self.computing(points, ranks) + self.collectives(points, ranks)

    def computing(self, points: float, ranks: int) -> float:
        """Return the seconds of an evaluation in which a rank computes.

        Parameters
        ----------
        points : float
            In all.
        ranks : int

        Returns
        -------
        float
        """
        shared = (self.level * math.log2(points) + self.point) * points
        return shared / ranks + self.repeated * points + self.fixed

    def collectives(self, points: float, ranks: int) -> float:
        """Return the seconds of an evaluation in which ranks exchange what they have computed.

        Parameters
        ----------
        points : float
            In all.
        ranks : int

        Returns
        -------
        float
        """
        if ranks == 1:
            return 0.0
        volume = self.bytes_a_point * points * (ranks - 1) / ranks
        return self.gathers * (self.latency * math.ceil(math.log2(ranks)) + volume / self.bandwidth)

    def efficiency(self, points: float, ranks: int) -> float:
        """Return the speed-up over one rank, divided by the ranks.

        Parameters
        ----------
        points : float
            In all.
        ranks : int

        Returns
        -------
        float
        """
        return self.seconds(points, 1) / (ranks * self.seconds(points, ranks))

    def recommended_ranks(self, points: float, available: int) -> int:
        """Return the largest number of ranks whose efficiency is at least `LEAST_EFFICIENCY`.

        Parameters
        ----------
        points : float
            In all.
        available : int
            Number of ranks.

        Returns
        -------
        int
        """
        enough = [
            ranks for ranks in range(1, available + 1) if self.efficiency(points, ranks) >= LEAST_EFFICIENCY
        ]
        return max(enough, default=1)


# Computing: processor times by `python -m tests.benchmarks.ranks` with 64, 256 and 1024 vesicles, within 15 %
# (Xeon, AVX-512).  Gathers: `ensemble report scaling --quick`.  Latency and bandwidth: the same report on an
# idle machine of two cores (EPYC, MPICH, shared memory).
MEASURED: Final = ScalingModel(
    level=4.3e-07,
    point=0.0,
    repeated=6e-07,
    fixed=0.001,
    gathers=35.0,
    bytes_a_point=9.4,
    latency=6.1e-06,
    bandwidth=1.6e09,
)


def recommended_ranks(scene: Scene, available: int, model: ScalingModel = MEASURED) -> int:
    """Return how many of the available ranks should share a run of a scene.

    Parameters
    ----------
    scene : Scene
    available : int
        Number of ranks.
    model : ScalingModel

    Returns
    -------
    int
    """
    points = scene.numerics.points
    on_each = _AUTOMATIC_POINTS if points == "auto" else points
    return model.recommended_ranks(len(independent_vesicles(scene)) * on_each, available)
