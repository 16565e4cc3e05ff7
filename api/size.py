"""How large a study or a scene may be: looked at before any work is done on it.

Its pairs of vesicles are compared with each other, those of a study at every value of its sweep.
"""

from __future__ import annotations

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


def limit_study(document: Any) -> None:
    """Refuse a study of too many points or vesicles.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    _at_most(MOST_VESICLES_SWEPT, document, "scene", "vesicles")
    _at_most(MOST_SWEEP_VALUES, document, "sweep", "values")


def _at_most(count: int, document: Any, *path: str) -> None:
    for name in path:
        document = document.get(name) if isinstance(document, dict) else None
    if isinstance(document, list) and len(document) > count:
        raise ValueError(f"{'.'.join(path)}: {len(document)} elements — must be at most {count}")
