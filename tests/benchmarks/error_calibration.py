"""Compare the errors that runs report with their true errors.

    python -m tests.benchmarks.error_calibration --scenes 60

Scenes are drawn with a fixed seed: pairs in shear and in extension, of several reduced areas, adhesion
strengths and distances, near critical values and far from them.  The truth is a run at a tolerance of 1e-9
with twice the points.  One line a scene, and at the end how many of the ratios true/reported are at most 3
and at least 1/3.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np

from solver import Run, Scene, simulate
from solver.membrane import curve
from solver.scene import Criteria, Numerics, Output

TRUTH = 1e-9
FACTOR = 3.0
ANSWERS = ("position", "period", "viscosity", "time")


def scenes(count: int, seed: int = 14) -> Iterator[Scene]:
    """Yield varied scenes."""
    random = np.random.default_rng(seed)
    for index in range(count):
        area = float(np.round(random.uniform(0.75, 0.95), 3))
        tolerance = float(10 ** random.choice([-4.0, -4.5, -5.0]))
        fields: dict[str, Any] = {"numerics": {"points": 64, "tolerance": tolerance}}
        fields["vesicles"] = [{"center": [x, 0.0], "reduced_area": area} for x in (-1.5, 1.5)]
        if index % 5 < 4:
            rate = float(random.uniform(0.4, 1.2))
            critical = 0.72 * rate  # roughly, at the distance 0.4 and the reduced area 0.9
            hamaker = critical * float(np.exp(random.uniform(-0.3, 1.5)))
            fields["flow"] = {"kind": "shear", "rate": rate}
            fields["horizon"] = 150.0
        else:
            hamaker = float(random.uniform(0.5, 2.0))
            fields["flow"] = {"kind": "extension", "rate": float(random.uniform(0.02, 0.1))}
            fields["vesicles"][1]["center"] = [1.5, 0.01]
            fields["horizon"] = 40.0
        fields["adhesion"] = {"hamaker": hamaker, "distance": float(random.choice([0.2, 0.4]))}
        yield Scene.model_validate(fields)


def finer(scene: Scene, factor: int, **changes: Any) -> Scene:
    """Return a scene with numerics that give the truth."""
    numerics = Numerics(points=factor * int(scene.numerics.points), tolerance=TRUTH)
    return scene.model_copy(update={"numerics": numerics, **changes})


def distance(run: Run, truth: Run) -> float:
    """Return the root mean square of the distances between the points at the end of a run."""
    assert truth.frames.time[1] == run.time
    length = np.array([vesicle.length for vesicle in run.scene.vesicles])
    given, true = (
        curve.positions(frames.tangent_angle[at], frames.center[at], length)
        for frames, at in ((run.frames, -1), (truth.frames, 1))
    )
    every = true.shape[-1] // given.shape[-1]
    return float(np.sqrt(np.sum((given - true[..., ::every]) ** 2, axis=-2).mean()))


def true_errors(run: Run, factor: int) -> dict[str, float | None]:
    """Return the true errors of a run's answers; None where it has none."""
    output = Output(interval=run.time, frame_interval=run.time)  # a frame at the end of the run
    truth = at_its_end = simulate(finer(run.scene, factor, output=output))
    if truth.time < run.time:
        undecided = Criteria(revolutions=1000, separated_distance=1e6, steady_rate=1e-300, steady_time=1e6)
        at_its_end = simulate(finer(run.scene, factor, output=output, horizon=run.time, criteria=undecided))
    same = run.outcome == truth.outcome
    # A motion counts as settled a turn sooner or later; what it changes from turn to turn is no error.
    turn = same and run.period is not None and abs(run.time - truth.time) < run.period / 4
    return {
        "position": distance(run, at_its_end),
        "period": abs(run.period - truth.period) if turn and run.period and truth.period else None,
        "viscosity": (
            abs(run.viscosity.total - truth.viscosity.total)
            if turn and run.viscosity and truth.viscosity
            else None
        ),
        "time": abs(run.time - truth.time) if run.error.time is not None and same else None,
    }


def compare(count: int, factor: int) -> None:
    """Print a line for each scene, and what they come to."""
    ratios: dict[str, list[float]] = {name: [] for name in ANSWERS}
    for scene in scenes(count):
        run = simulate(scene)
        if run.failure:
            print(f"failed: {run.failure}", flush=True)
            continue
        true = true_errors(run, factor)
        reported = {"position": run.error.global_} | {name: getattr(run.error, name) for name in ANSWERS[1:]}
        cells = [f"{run.outcome:10} t={run.time:7.2f} {'sensitive' if run.sensitive else '':9}"]
        for name in ANSWERS:
            if true[name] is None or reported[name] is None:
                continue
            ratio = true[name] / max(reported[name], 1e-300)
            ratios[name].append(ratio)
            cells.append(f"{name} {true[name]:.1e}/{reported[name]:.1e} = {ratio:.2f}")
        print("  ".join(cells), flush=True)
    for name, values in ratios.items():
        found = np.array(values)
        if found.size:
            within = np.mean((found <= FACTOR) & (found >= 1 / FACTOR))
            print(
                f"{name}: {found.size} values, within a factor of 3 {within:.0%}, "
                f"at most 3 times too small {np.mean(found <= FACTOR):.0%}, median {np.median(found):.2f}"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--points-factor", type=int, default=2, help="of the truth")
    arguments = parser.parse_args()
    compare(arguments.scenes, arguments.points_factor)
