"""Scenes of many vesicles, small enough for matrices over all points as well."""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.scene import Numerics, PowerLaw, Scene, Shear, Vesicle


def suspension(count: int, points: int = 32, tolerance: float = 1e-3, **fields: Any) -> Scene:
    """Vesicles of different sizes and shapes, adhering, on a jittered lattice of gaps of about a half."""
    random = np.random.default_rng(count)
    columns = int(np.ceil(np.sqrt(count)))
    vesicles = tuple(
        Vesicle(
            reduced_area=random.uniform(0.85, 0.98),
            length=random.uniform(5.0, 6.3),
            bending_modulus=random.uniform(0.5, 2.0),
            center=(2.75 * (k % columns) + random.uniform(-0.1, 0.1), 2.75 * (k // columns)),
            angle=random.uniform(0.0, np.pi),
        )
        for k in range(count)
    )
    defaults: dict[str, Any] = {
        "horizon": 1.0,
        "vesicles": vesicles,
        "adhesion": PowerLaw(hamaker=1.0, distance=0.4),
        "flow": Shear(rate=1.0),
        "numerics": Numerics(points=points, tolerance=tolerance),
    }
    return Scene(**defaults | fields)
