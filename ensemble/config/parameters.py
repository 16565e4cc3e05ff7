"""Numbers of a scene by dotted path."""

from __future__ import annotations

from ensemble.config.overrides import locations, value_at
from solver.scene import Scene


def parameter_value(scene: Scene, path: str) -> float:
    """Return the number at a dotted path, which may name several places that hold the same one.

    Raises
    ------
    ValueError
        If there is none, or there are different ones.
    """
    document = scene.model_dump()
    values = {value_at(document, location) for location in locations(document, path)}
    (value, *others) = values
    if others or not isinstance(value, int | float):
        raise ValueError(f"{path}: not one number in this scene")
    return value
