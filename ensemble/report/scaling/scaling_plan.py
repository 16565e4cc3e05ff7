"""What the scaling report measures."""

from __future__ import annotations

from dataclasses import dataclass

from solver.scene import Numerics, PowerLaw, Scene, Shear, Vesicle
from solver.scene.arrangement import Random

POINTS = 64  # on each vesicle


@dataclass(frozen=True)
class ScalingPlan:
    """Numbers of vesicles to measure.

    Attributes
    ----------
    shared : tuple of int
        Measured on every number of ranks.
    single : tuple of int
        Measured on one rank, for cost and memory; ascending.
    weak : int
        Measured on one rank, and G times as many on G ranks.
    repeats : int
        How often each evaluation is repeated.
    groups : tuple of (int, float)
        Numbers of groups of ranks that are simulated, and how many times as long as stored runs theirs take.
    """

    shared: tuple[int, ...]
    single: tuple[int, ...]
    weak: int
    repeats: int
    groups: tuple[tuple[int, float], ...] = ()


QUICK = ScalingPlan(
    shared=(2, 16, 64),
    single=(2, 8, 16, 32, 64, 128),
    weak=32,
    repeats=6,
    groups=((16, 1.0), (256, 1.0), (256, 100.0)),
)
FULL = ScalingPlan(
    shared=(2, 16, 64, 256, 1024),
    single=(2, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096),
    weak=64,
    repeats=12,
    groups=(*QUICK.groups, (4096, 100.0)),
)


def suspension(vesicles: int) -> Scene:
    """Return adhering vesicles in shear.

    Parameters
    ----------
    vesicles : int
        Their number.

    Returns
    -------
    Scene
        The published pair, or vesicles at random places that fill a fifth of a square.
    """
    pair = (Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.0)))
    placed = pair if vesicles == 2 else Random(count=vesicles, area_fraction=0.2, seed=1).vesicles()
    return Scene(
        horizon=20.0,
        vesicles=placed,
        adhesion=PowerLaw(hamaker=1.5, distance=0.4),
        flow=Shear(rate=0.5),
        numerics=Numerics(points=POINTS),
    )
