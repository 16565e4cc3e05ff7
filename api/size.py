"""How large a study or a scene may be: looked at before any work is done on it.

Its vesicles are found places for and compared with each other, those of a study at every value of its sweep.
"""

from __future__ import annotations

import math
from typing import Any

MOST_VESICLES = 32
MOST_VESICLES_SWEPT = 4
MOST_SWEEP_VALUES = 64


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
    numbers = [found.get(name) for name in ("count", "columns", "rows")]
    asked = math.prod(number for number in numbers if isinstance(number, int))
    if asked > count:
        raise ValueError(f"{'.'.join(path)}: {asked} vesicles — must be at most {count}")


def _found(document: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        document = document.get(name) if isinstance(document, dict) else None
    return document
