"""How large a study or a scene may be: looked at before any work is done on it.

Its vesicles are found places for and compared with each other, those of a study at every value of its sweep.
"""

from __future__ import annotations

import math
from typing import Any

from pydantic import TypeAdapter, ValidationError

MOST_VESICLES = 256
MOST_VESICLES_SWEPT = 4
MOST_SWEEP_VALUES = 64
NUMBER = TypeAdapter(int)


def limit_scene(document: Any) -> None:
    """Refuse a scene of too many vesicles.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    _at_most(MOST_VESICLES, document, "vesicles")
    _arranged_at_most(MOST_VESICLES, document, "arrangement")


def limit_study(document: Any) -> None:
    """Refuse a study of too many points or vesicles.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    _at_most(MOST_VESICLES_SWEPT, document, "scene", "vesicles")
    _arranged_at_most(MOST_VESICLES_SWEPT, document, "scene", "arrangement")
    _at_most(MOST_SWEEP_VALUES, document, "sweep", "values")


def _at_most(count: int, document: Any, *path: str) -> None:
    found = _found(document, path)
    if isinstance(found, list) and len(found) > count:
        raise ValueError(f"{'.'.join(path)}: {len(found)} elements — must be at most {count}")


def _arranged_at_most(count: int, document: Any, *path: str) -> None:
    found = _found(document, path)
    if not isinstance(found, dict):
        return
    asked = math.prod(_number(found[name]) for name in ("count", "columns", "rows") if name in found)
    if asked > count:
        raise ValueError(f"{'.'.join(path)}: {asked} vesicles — must be at most {count}")


def _number(value: Any) -> int:
    """Read a number as the model does, to which "40" and 40.0 are 40; what is none, it refuses by itself."""
    try:
        return NUMBER.validate_python(value)
    except ValidationError:
        return 1


def _found(document: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        document = document.get(name) if isinstance(document, dict) else None
    return document
