"""Scenes drawn at random over wide ranges, and what a run of one must keep to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import ValidationError

from solver.analysis.run import Outcome, Run
from solver.scene import Scene
from solver.scene.ellipses import semi_axes

SEED = 20260
WORK_LIMIT = 3_000  # evaluations

# Ends of log-uniform ranges.  Strains, times and strengths go together, so that something happens in a run.
RANGES = {
    "length": (0.3, 60.0),
    "bending_modulus": (1e-4, 1e4),
    "viscosity_contrast": (1e-3, 1e3),
    "hamaker": (1e-4, 1e4),
    "distance": (0.005, 2.0),
    "rate": (1e-3, 1e3),
    "tolerance": (1e-9, 1e-2),
    "points": (16, 128),
    "strain": (0.1, 300.0),  # horizon times rate, or in units of the time in which bending acts
    "gap": (0.3, 10.0),  # over the adhesion distance
}


def random_scenes(count: int, wall_limit: float) -> Iterator[tuple[str, Scene]]:
    """Return names and scenes, the same ones every time; the first ones do not depend on the count."""
    for index in range(count):
        random = np.random.default_rng([SEED, index])
        while True:  # a few draws are refused, such as exponents in the wrong order
            try:
                scene = Scene.model_validate(_document(random, wall_limit))
            except ValidationError:
                continue
            yield f"{index:03d}", scene
            break


def _document(random: np.random.Generator, wall_limit: float) -> dict[str, Any]:
    def drawn(name: str) -> float:
        low, high = np.log(RANGES[name])
        return float(np.exp(random.uniform(low, high)))

    length, modulus = drawn("length"), drawn("bending_modulus")
    vesicle = {
        "reduced_area": 1 - float(np.exp(random.uniform(np.log(1e-4), np.log(0.8)))),
        "length": length,
        "bending_modulus": modulus,
        "viscosity_contrast": drawn("viscosity_contrast") if random.random() < 0.3 else 1.0,
    }
    unit, natural = length / (2 * math.pi), modulus * (2 * math.pi / length) ** 3
    distance = unit * drawn("distance")
    kind = random.choice(["rest", "shear", "extension", "trap"])
    rate = natural * drawn("rate")
    document: dict[str, Any] = {
        "horizon": drawn("strain") / (natural if kind == "rest" else rate),
        "vesicles": _placed(random, vesicle, distance * drawn("gap")),
        "numerics": {
            "points": 2 * round(drawn("points") / 2),
            "tolerance": drawn("tolerance"),
            "integrator": str(random.choice(["auto", "bdf", "rosenbrock", "sdc", "imex-euler"])),
            "work_limit": WORK_LIMIT,
            "wall_limit": wall_limit,
        },
    }
    document["output"] = dict.fromkeys(("interval", "frame_interval"), document["horizon"] / 100)
    if kind != "rest":
        document["flow"] = {"kind": str(kind), "rate": rate}
    if len(document["vesicles"]) > 1 and random.random() < 0.8:
        document["adhesion"] = {
            "hamaker": natural * drawn("hamaker"),
            "distance": distance,
            "exponents": sorted(random.integers(2, 25, 2).tolist(), reverse=True),
        }
        if random.random() < 0.3:
            document["adhesion"]["cutoff"] = distance * (1 + float(np.exp(random.uniform(-6.0, 2.0))))
    return document


def _placed(random: np.random.Generator, vesicle: dict[str, Any], gap: float) -> list[dict[str, Any]]:
    """Return one vesicle, two equal ones or two unequal ones, ``gap`` apart, at any angle."""
    count = random.choice([1, 2, 2, 2])
    angle = float(random.uniform(0, np.pi))
    first = vesicle | {"angle": angle}
    if count == 1:
        return [first]
    second = first | {"reduced_area": random.uniform(0.5, 1.0)} if random.random() < 0.3 else first
    widths = [semi_axes(v["reduced_area"], v["length"])[1] for v in (first, second)]
    along, across = random.normal(0, 0.3 * vesicle["length"] / (2 * np.pi)), sum(widths) + gap
    offset = 0.5 * (across * np.exp(1j * (angle + np.pi / 2)) + along * np.exp(1j * angle))
    return [v | {"center": [s * offset.real, s * offset.imag]} for s, v in ((-1, first), (1, second))]


def objections(run: Run) -> list[str]:
    """What a run has done that no run may do, whatever its scene."""
    found = []
    if not 0 <= run.time <= run.scene.horizon:
        found.append(f"it ends at {run.time}")
    if (run.outcome is Outcome.FAILED) != bool(run.failure):
        found.append(f"{run.outcome} for the reason {run.failure!r}")
    for name, values in run.series.items():
        # At a start without a motion there are diagnostics that do not exist.
        begun = values if run.time > 0 else values[:0]
        if not np.all(np.isfinite(begun)):
            found.append(f"{name} is not finite")
    if not np.all(np.isfinite(run.frames.tangent_angle)) or not np.all(np.isfinite(run.frames.center)):
        found.append("its states are not finite")
    return found
