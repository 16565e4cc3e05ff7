"""Stiff and extreme scenes: those on which a solver for vesicles is likely to fail.

Every scene differs from an ordinary doublet or vesicle in the few ways that its name states.  A quick report
runs the first scene of each group.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel

from solver.scene import (
    Criteria,
    Extension,
    Numerics,
    Output,
    PowerLaw,
    Scene,
    Shear,
    Start,
    Trap,
    Vesicle,
)
from solver.scene.ellipses import semi_axes

WORK_LIMIT = 40_000  # evaluations of the right-hand side
SAMPLES = 200  # recorded diagnostics in a run

AT_REST, IN_FLOW, LONG = 50.0, 20.0, 1e4  # horizons


def _scene(*vesicles: Vesicle, **fields: Any) -> Scene:
    """Return a scene with these vesicles and fields of `Scene`, `Numerics` and `Criteria`."""
    numerics = Numerics(**({"work_limit": WORK_LIMIT} | _fields_of(Numerics, fields)))
    criteria = Criteria(**_fields_of(Criteria, fields))
    horizon = fields.pop("horizon", IN_FLOW if "flow" in fields else AT_REST)
    return Scene(
        horizon=horizon,
        vesicles=vesicles,
        numerics=numerics,
        criteria=criteria,
        output=Output(interval=horizon / SAMPLES, frame_interval=horizon / 10),
        **fields,
    )


def _pair(gap: float = 1.0, shift: float = 0.2, **fields: Any) -> Scene:
    """Return two upright vesicles side by side, ``gap`` apart and a little shifted along each other.

    Fields of `Vesicle` and `PowerLaw`, and those that `_scene` takes, change the defaults.
    """
    adhesion = PowerLaw(**({"hamaker": 1.5, "distance": 0.4} | _fields_of(PowerLaw, fields)))
    vesicle = Vesicle(**_fields_of(Vesicle, fields))
    _, half_width = semi_axes(vesicle.reduced_area, vesicle.length)
    centers = [(side * (half_width + gap / 2), side * shift / 2) for side in (-1, 1)]
    vesicles = [vesicle.model_copy(update={"center": center}) for center in centers]
    return _scene(*vesicles, adhesion=adhesion, **fields)


def _unequal(first: Mapping[str, Any], second: Mapping[str, Any], **fields: Any) -> Scene:
    """Return two upright vesicles that differ, one length unit apart."""
    vesicles = []
    for side, vesicle_fields in ((-1, first), (1, second)):
        vesicle = Vesicle(**vesicle_fields)
        _, half_width = semi_axes(vesicle.reduced_area, vesicle.length)
        center = (side * (half_width + 0.5), side * 0.1)
        vesicles.append(vesicle.model_copy(update={"center": center}))
    return _scene(*vesicles, adhesion=PowerLaw(hamaker=1.5, distance=0.4), **fields)


def _fields_of(model: type[BaseModel], fields: dict[str, Any]) -> dict[str, Any]:
    """Take the fields that belong to a model out of all fields."""
    return {name: fields.pop(name) for name in tuple(fields) if name in model.model_fields}


_SHEAR = Shear(rate=0.5)

EXTREME_SCENES: Mapping[str, Mapping[str, Scene]] = MappingProxyType(
    {
        "potential": {
            "exponents (12, 6), shear": _pair(exponents=(12, 6), flow=_SHEAR),
            "exponents (12, 6), distance 0.1, shear": _pair(
                gap=0.3, exponents=(12, 6), distance=0.1, flow=_SHEAR
            ),
            "exponents (24, 12), shear": _pair(exponents=(24, 12), flow=_SHEAR),
            "exponents (24, 12), at rest": _pair(gap=0.6, exponents=(24, 12)),
            "exponents (24, 12), distance 0.1, H 10, at rest": _pair(
                gap=0.15, exponents=(24, 12), distance=0.1, hamaker=10.0
            ),
        },
        # H·distance is constant: at every distance adhesion is strong enough to pull the membranes together.
        "adhesion distance": {
            "distance 0.1, at rest": _pair(gap=0.2, distance=0.1, hamaker=6.0),
            "distance 0.4, at rest": _pair(gap=0.8, distance=0.4, hamaker=1.5),
            "distance 0.2, at rest": _pair(gap=0.4, distance=0.2, hamaker=3.0),
            "distance 0.05, at rest": _pair(gap=0.1, distance=0.05, hamaker=12.0),
            "distance 0.02, at rest": _pair(gap=0.04, distance=0.02, hamaker=30.0),
            "distance 0.01, at rest": _pair(gap=0.02, distance=0.01, hamaker=60.0),
            "distance 0.05, shear": _pair(gap=0.1, distance=0.05, hamaker=12.0, flow=_SHEAR),
            "distance 0.01, shear": _pair(gap=0.02, distance=0.01, hamaker=60.0, flow=_SHEAR),
            "distance 0.02, at rest, N 256": _pair(gap=0.04, distance=0.02, hamaker=30.0, points=256),
        },
        "adhesion strength": {
            "H 100, at rest": _pair(hamaker=100.0),
            "H 10, at rest": _pair(hamaker=10.0),
            "H 1000, at rest": _pair(hamaker=1000.0),
            "H 1000, shear": _pair(hamaker=1000.0, flow=_SHEAR),
            "H 0.001, shear": _pair(hamaker=1e-3, flow=_SHEAR),
            "H 0, shear": _pair(hamaker=0.0, flow=_SHEAR),
        },
        "reduced area": {
            "reduced area 0.5, shear": _pair(reduced_area=0.5, flow=_SHEAR),
            "reduced area 0.3, shear": _pair(reduced_area=0.3, flow=_SHEAR),
            "reduced area 0.999, shear": _pair(reduced_area=0.999, flow=_SHEAR),
            "reduced area 1, shear": _pair(reduced_area=1.0, flow=_SHEAR),
            "reduced area 0.3, at rest": _pair(reduced_area=0.3),
            "reduced area 1, at rest": _pair(reduced_area=1.0),
            "reduced area 0.3, one vesicle, at rest": _scene(Vesicle(reduced_area=0.3)),
            "reduced area 1, one vesicle, shear": _scene(Vesicle(reduced_area=1.0), flow=_SHEAR),
            "reduced area 0.3, trap": _pair(reduced_area=0.3, flow=Trap(rate=0.05)),
        },
        "bending modulus": {
            "bending modulus 0.01, shear": _pair(bending_modulus=1e-2, flow=_SHEAR),
            "bending modulus 0.0001, shear": _pair(bending_modulus=1e-4, flow=_SHEAR),
            "bending modulus 0.0001, H 0.0001, shear": _pair(bending_modulus=1e-4, hamaker=1e-4, flow=_SHEAR),
            "bending modulus 100, shear": _pair(bending_modulus=1e2, flow=_SHEAR),
            "bending modulus 100, at rest": _pair(bending_modulus=1e2),
            "bending modulus 0.0001, one vesicle, shear": _scene(Vesicle(bending_modulus=1e-4), flow=_SHEAR),
        },
        "viscosity contrast": {
            "contrast 1000, one vesicle, shear": _scene(Vesicle(viscosity_contrast=1e3), flow=_SHEAR),
            "contrast 10, shear": _pair(viscosity_contrast=10.0, flow=_SHEAR),
            "contrast 0.01, shear": _pair(viscosity_contrast=1e-2, flow=_SHEAR),
            "contrast 1000, at rest": _pair(viscosity_contrast=1e3),
            "contrasts 0.01 and 1000, shear": _unequal(
                {"viscosity_contrast": 1e-2}, {"viscosity_contrast": 1e3}, flow=_SHEAR
            ),
        },
        "cutoff": {
            "cutoff 1.5, shear": _pair(cutoff=1.5, flow=_SHEAR),
            "cutoff 0.5, distance 0.4, at rest": _pair(gap=0.45, cutoff=0.5),
        },
        "flow rate": {
            "shear rate 10": _pair(flow=Shear(rate=10.0), horizon=10.0),
            "shear rate 0.001": _pair(flow=Shear(rate=1e-3), horizon=1000.0),
            "shear rate 100": _pair(flow=Shear(rate=100.0), horizon=2.0),
            "shear rate 100, one vesicle": _scene(Vesicle(), flow=Shear(rate=100.0), horizon=2.0),
            "shear rate 100, H 1000": _pair(hamaker=1000.0, flow=Shear(rate=100.0), horizon=2.0),
            "extension rate 10": _pair(flow=Extension(rate=10.0), horizon=2.0),
            "trap, rate 1": _pair(flow=Trap(rate=1.0), horizon=IN_FLOW),
        },
        "arrangement": {
            "start at a quarter of the adhesion distance, at rest": _pair(gap=0.1),
            "start at a hundredth of the adhesion distance, at rest": _pair(gap=0.004),
            "start at a quarter of the adhesion distance, (12, 6), at rest": _pair(
                gap=0.1, exponents=(12, 6)
            ),
            "start 20 apart, at rest": _pair(gap=20.0),
            "start 20 apart, shear": _pair(gap=20.0, shift=0.5, flow=_SHEAR, horizon=200.0),
            "lengths 1 to 4, shear": _unequal({"length": math.pi}, {"length": 4 * math.pi}, flow=_SHEAR),
            "bending moduli 0.01 and 100, shear": _unequal(
                {"bending_modulus": 1e-2}, {"bending_modulus": 1e2}, flow=_SHEAR
            ),
            "lengths 1 to 4, bending moduli 100 and 0.01, at rest": _unequal(
                {"length": math.pi, "bending_modulus": 1e2},
                {"length": 4 * math.pi, "bending_modulus": 1e-2},
            ),
        },
        "resolution": {
            "N 16, shear": _pair(points=16, flow=_SHEAR),
            "N 16, distance 0.1, shear": _pair(gap=0.3, distance=0.1, points=16, flow=_SHEAR),
            "N 32, reduced area 0.4, shear": _pair(reduced_area=0.4, points=32, flow=_SHEAR),
            "N 256, shear": _pair(points=256, flow=_SHEAR),
            "N 512, shear": _pair(points=512, flow=_SHEAR, horizon=5.0),
            "tolerance 0.01, shear": _pair(tolerance=0.01, flow=_SHEAR),
            "tolerance 1e-10, shear": _pair(tolerance=1e-10, flow=_SHEAR),
        },
        "long runs": {
            "T 10000, one vesicle, shear": _scene(Vesicle(), flow=_SHEAR, horizon=LONG, steady_time=LONG),
            "T 10000, at rest": _pair(horizon=LONG, steady_time=LONG),
            "T 10000, trap": _pair(
                gap=0.4,
                shift=0.01,
                reduced_area=0.8,
                hamaker=0.7,
                flow=Trap(rate=0.05),
                horizon=LONG,
                steady_time=LONG,
                start=Start(relaxed=True, horizon=2 * LONG),  # as steady as the run itself
            ),
            "T 10000, shear": _pair(
                flow=_SHEAR,
                horizon=LONG,
                revolutions=10_000,
                work_limit=10 * WORK_LIMIT,
            ),
        },
    }
)
