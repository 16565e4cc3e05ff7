"""Scenes that several tests share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry, Membranes
from solver.scene import PowerLaw, Scene, Shear, Vesicle
from solver.simulation.initial_state import placed_state

Array = NDArray[np.float64]


def shear_pair(hamaker: float, rate: float = 0.5, horizon: float = 400.0, **fields: Any) -> Scene:
    """The published scene: upright ellipses of reduced area 0.9, three lengths/2π apart, in shear."""
    return Scene(
        horizon=horizon,
        vesicles=(Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.0))),
        adhesion=PowerLaw(hamaker=hamaker, distance=0.4),
        flow=Shear(rate=rate),
        **fields,
    )


def uneven_pair(hamaker: float = 1.5, exponents: tuple[int, int] = (4, 2), **fields: Any) -> Scene:
    """Two vesicles without any symmetry, of different sizes, shapes and moduli, with a gap of about 0.5."""
    defaults: dict[str, Any] = {
        "horizon": 10.0,
        "vesicles": (
            Vesicle(reduced_area=0.85, center=(-1.1, 0.1), angle=1.3),
            Vesicle(reduced_area=0.95, length=5.0, bending_modulus=2.5, center=(0.85, -0.2), angle=0.4),
        ),
        "adhesion": PowerLaw(hamaker=hamaker, distance=0.4, exponents=exponents),
    }
    return Scene(**defaults | fields)


def smooth_direction(membranes: Membranes, seed: int = 3) -> Array:
    """A change of state with smooth tangent angles, (state_size,)."""
    random = np.random.default_rng(seed)
    alpha = 2 * np.pi * np.arange(membranes.points) / membranes.points
    modes = np.array([wave(k * alpha) for k in range(5) for wave in (np.cos, np.sin)])
    tangent_angle = random.standard_normal((membranes.count, len(modes))) @ modes
    return membranes.pack(0.1 * tangent_angle, 0.3 * random.standard_normal((membranes.count, 2)))


def geometry_of(scene: Scene) -> Geometry:
    """The geometry in which a scene begins."""
    return Geometry(Membranes.of_scene(scene), placed_state(scene))


def with_contrasts(scene: Scene, *contrasts: float) -> Scene:
    """The scene with these viscosity contrasts of its vesicles."""
    vesicles = tuple(
        vesicle.model_copy(update={"viscosity_contrast": contrast})
        for vesicle, contrast in zip(scene.vesicles, contrasts, strict=True)
    )
    return scene.model_copy(update={"vesicles": vesicles})


def closing(membranes: Membranes, state: Array, direction: Array) -> Array:
    """The direction without what would open the curves of a state."""
    angle, change = membranes.tangent_angle(state), membranes.tangent_angle(direction).copy()
    for vesicle in range(membranes.count):
        tangents = np.stack([np.cos(angle[vesicle]), np.sin(angle[vesicle])], axis=1)
        change[vesicle] -= tangents @ np.linalg.lstsq(tangents, change[vesicle])[0]
    return membranes.pack(change, membranes.center(direction))
