"""Compiles the kernels, which Numba keeps beside their sources for every process that follows."""

from __future__ import annotations

import sys

from solver.scene import LARGEST_DENSE, PowerLaw, Scene
from solver.simulation.simulate import simulate
from tests.solver.scenes import uneven_pair, with_contrasts
from tests.solver.suspensions import suspension

HORIZON = 1e-3
COUNT = LARGEST_DENSE + 1


def scenes_that_use_every_kernel() -> list[Scene]:
    """Return scenes of few and of many vesicles, with every formula of adhesion, and with a contrast."""
    pair = uneven_pair(horizon=HORIZON)
    many = suspension(COUNT, horizon=HORIZON)
    adhesions = [
        PowerLaw(hamaker=1.0, distance=0.4, exponents=exponents, cutoff=cutoff)
        for exponents in ((4, 2), (5, 3))
        for cutoff in (None, 1.2)
    ]
    return [
        *(scene.model_copy(update={"adhesion": each}) for scene in (pair, many) for each in adhesions),
        with_contrasts(pair, 2.0, 0.5),
        with_contrasts(many, *[2.0] * COUNT),
    ]


if __name__ == "__main__":
    scenes = scenes_that_use_every_kernel()
    for scene in reversed(scenes) if "reversed" in sys.argv else scenes:
        simulate(scene)
