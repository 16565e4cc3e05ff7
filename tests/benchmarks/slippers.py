"""A vesicle in Poiseuille flow: slipper or symmetric, beside published shapes.

    python -m tests.benchmarks.slippers [--scale 8]

First the rates at which the symmetric shape becomes stable, by continuation from a fast flow.  Then the
inclination of the final shape for published peak velocities, one of which stands for the rate ``--scale``.
A minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ensemble import load_scene
from ensemble.config.overrides import override
from ensemble.config.validation import validated
from solver import Run, Scene, simulate
from solver.simulation.steady_scenes import follow_steady_states
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.continuation import Limits

# Degrees, by reduced area, at peak velocities of 400, 800, 1200 and 1600 µm/s.
PUBLISHED: Mapping[float, tuple[float, ...]] = MappingProxyType(
    {
        0.6: (39.0, 49.6, 58.6, 67.1),
        0.7: (47.2, 76.3, 85.5, 86.9),
        0.8: (66.4, 86.2, 89.0, 89.2),
        0.9: (90.0, 90.0, 90.0, 90.0),
    }
)
FAST = 60.0  # a rate at which all are symmetric


def scene_at(reduced_area: float, rate: float) -> Scene:
    """Return the preset with these values."""
    return load_scene("vesicle-poiseuille", [f"vesicles.reduced_area={reduced_area}", f"flow.rate={rate}"])


def inclination(run: Run) -> float:
    """Return the inclination of the long axis to the flow, degrees from 0 to 90."""
    assert run.inclination_angle is not None
    return abs(run.inclination_angle)


def symmetric_from(reduced_area: float) -> float:
    """Return the rate from which on the symmetric shape is stable."""
    scene = scene_at(reduced_area, FAST)
    frames = simulate(scene).frames

    def at(rate: float) -> Scene:
        return validated(Scene, override(scene.model_dump(), {"flow.rate": rate}))

    near = Shapes(frames.tangent_angle[-1], frames.center[-1])
    branch = follow_steady_states(at, FAST, near, Limits(1.0), upward=False)
    (crossing,) = branch.crossings
    return crossing.parameter


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=8.0, help="rate that stands for 400 µm/s")
    scale = parser.parse_args().scale
    differences = []
    for reduced_area, published in PUBLISHED.items():
        print(f"reduced area {reduced_area}: symmetric from rate {symmetric_from(reduced_area):.5g} on")
        for number, theirs in enumerate(published, start=1):
            run = simulate(scene_at(reduced_area, number * scale))
            ours = inclination(run)
            differences.append(ours - theirs)
            print(f"  rate {number * scale:g}: {run.outcome}, {ours:.1f} degrees, published {theirs}")
    print(f"root mean square difference {np.sqrt(np.mean(np.square(differences))):.2f} degrees")


if __name__ == "__main__":
    main()
