"""How large a document may be that a service takes: looked at before any work is done on it.

Its vesicles are placed and compared with each other; those of a study at every point of its boundary.
"""

from __future__ import annotations

import math
from typing import Any

from pydantic import TypeAdapter, ValidationError

MOST_VESICLES = 256
MOST_VESICLES_SWEPT = 4
MOST_SWEEP_VALUES = 64
MOST_BOUNDARY_POINTS = 256

_INTEGER = TypeAdapter(int)


def limit_elements(document: Any, most: int, *path: str) -> None:
    """Refuse a document in which an array has too many elements.

    Parameters
    ----------
    document : object
        It has not been checked and may be anything.
    most : int
        How many elements the array may have.
    *path : str
        Names of the tables around the array and of the array itself.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    array = _at(document, path)
    if isinstance(array, list) and len(array) > most:
        raise ValueError(f"{'.'.join(path)}: {len(array)} elements — must be at most {most}")


def limit_points(document: Any, most: int, *path: str) -> None:
    """Refuse a study whose sweeps have too many values, or too many combinations of them.

    Parameters
    ----------
    document : object
        It has not been checked and may be anything.
    most : int
        How many combinations there may be.
    *path : str
        Names of the tables around the sweeps and of themselves.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    sweeps = _at(document, path)
    if not isinstance(sweeps, list):
        limit_elements(document, MOST_SWEEP_VALUES, *path, "values")
        return
    arrays = [sweep["values"] for sweep in sweeps if isinstance(sweep, dict) and "values" in sweep]
    count = math.prod(len(array) for array in arrays if isinstance(array, list))
    if count > most:
        raise ValueError(f"{'.'.join(path)}: {count} combinations of values — must be at most {most}")


def limit_vesicles(document: Any, most: int, *path: str) -> None:
    """Refuse a document in which a scene has too many vesicles, listed or arranged.

    Parameters
    ----------
    document : object
        It has not been checked and may be anything.
    most : int
        How many vesicles the scene may have.
    *path : str
        Names of the tables around the scene and of the scene itself.

    Raises
    ------
    ValueError
        With the number that is allowed.
    """
    limit_elements(document, most, *path, "vesicles")
    arrangement = _at(document, (*path, "arrangement"))
    if not isinstance(arrangement, dict):
        return
    factors = [arrangement[name] for name in ("count", "columns", "rows") if name in arrangement]
    count = math.prod(map(_number, factors))
    if count > most:
        raise ValueError(f"{'.'.join((*path, 'arrangement'))}: {count} vesicles — must be at most {most}")


def _number(value: Any) -> int:
    """Read a number as the model does, which takes "40" and 40.0 for 40 and refuses everything else."""
    try:
        return _INTEGER.validate_python(value)
    except ValidationError:
        return 1


def _at(document: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        document = document.get(name) if isinstance(document, dict) else None
    return document
