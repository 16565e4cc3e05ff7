"""Where steady states end, at two numbers of points, with the time that each limit takes.

    python -m tests.benchmarks.steady_limits [--areas 0.65 0.7 ...] [--points 64 96]

The fluid trap: the fold of side by side, the fold and the crossing of tip to tip.  One vesicle in shear at
the rate 1: the viscosity contrast at the fold of treading.  Tip to tip is reached by a run at the reduced
area 0.8 and then followed to the others.  Seconds are of the processor, the run that gives the start
included.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial

from ensemble import load_scene
from ensemble.config.overrides import override
from ensemble.config.validation import validated
from solver import Scene, simulate
from solver.simulation.steady_scenes import SteadyBranch, follow_steady_states
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.continuation import Limits, OutsideParameterError

RATE, AREA, CONTRAST = "flow.rate", "vesicles.reduced_area", "vesicles.viscosity_contrast"
AREAS = (0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
SHOWN = 0.8  # reduced area at which tip to tip is reached by a run
LEAST_RATE = 0.01


def changed(scene: Scene, parameter: str, value: float) -> Scene:
    """Return the scene with another value of a parameter."""
    try:
        return validated(Scene, override(scene.model_dump(), {parameter: value}))
    except ValueError as error:
        raise OutsideParameterError(str(error)) from error


def end_of(scene: Scene) -> Shapes:
    """Return the shapes at the end of the scene's run."""
    frames = simulate(scene).frames
    return Shapes(frames.tangent_angle[-1], frames.center[-1])


def branch(scene: Scene, near: Shapes, parameter: str, start: float, to: float) -> SteadyBranch:
    """Follow the steady states of a scene."""
    return follow_steady_states(partial(changed, scene, parameter), start, near, Limits(to), to > start)


def scene_of(preset: str, points: int, fields: dict[str, float]) -> Scene:
    """Return a preset with these values."""
    changes = fields | {"numerics.points": points}
    return load_scene(preset, [f"{path}={value}" for path, value in changes.items()])


def side_by_side(area: float, points: int) -> dict[str, float | str]:
    """Return the rate at which it ends."""
    scene = scene_of("doublet-trap", points, {AREA: area, RATE: 0.05})
    return {"side by side ends": fold(branch(scene, end_of(scene), RATE, 0.05, 10.0))}


def treading(area: float, points: int) -> dict[str, float | str]:
    """Return the contrast at which it ends."""
    scene = scene_of("vesicle-shear", points, {AREA: area, RATE: 1.0, CONTRAST: 2.0})
    return {"treading ends": fold(branch(scene, end_of(scene), CONTRAST, 2.0, 100.0))}


def tip_to_tip(area: float, points: int) -> dict[str, float | str]:
    """Return the rates at which it ends and begins."""
    scene = scene_of("doublet-trap", points, {AREA: SHOWN, RATE: 0.1})
    near = end_of(scene)
    if area != SHOWN:
        there = branch(scene, near, AREA, SHOWN, area)
        last = there.points[-1]
        if last.parameter != area:
            return {"tip to tip": f"not followed beyond {last.parameter:g}: {there.ended}"}
        scene, near = changed(scene, AREA, area), last.state.shapes
    upper, lower = branch(scene, near, RATE, 0.1, 10.0), branch(scene, near, RATE, 0.1, LEAST_RATE)
    crossings = [point.parameter for point in lower.crossings]
    begins = max(crossings) if crossings else f"no crossing: {lower.ended}"
    return {"tip to tip ends": fold(upper), "tip to tip begins": begins}


def fold(followed: SteadyBranch) -> float | str:
    """Return the first fold of a branch, or why it has none."""
    return followed.folds[0].parameter if followed.folds else f"no fold: {followed.ended}"


def compare(areas: Sequence[float], numbers: Sequence[int]) -> None:
    """Print a line for each limit, reduced area and number of points."""
    for limits in (side_by_side, treading, tip_to_tip):
        for area in areas:
            for points in numbers:
                began = time.process_time()
                try:
                    found = limits(area, points)
                except ArithmeticError as error:
                    found = {limits.__name__: str(error)}
                seconds = time.process_time() - began
                for name, value in found.items():
                    shown = value if isinstance(value, str) else f"{value:.11g}"
                    print(f"{name:18} {area:<5g} N={points:<3} {shown:14}  {seconds:5.1f} s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--areas", type=float, nargs="+", default=AREAS)
    parser.add_argument("--points", type=int, nargs="+", default=(64, 96))
    arguments = parser.parse_args()
    compare(arguments.areas, arguments.points)
