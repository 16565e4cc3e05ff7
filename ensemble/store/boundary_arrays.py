"""A boundary as arrays over the values of its swept parameters, in files and as a data set of xarray."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store.flagged_text import Flags, data_variable
from ensemble.store.run_record import NamedArray, parameter_attributes

if TYPE_CHECKING:
    import xarray

SIDE: Final = "side"
SIDES: Final = ("low", "high")
# What every boundary has as arrays over the parameters.
BOUNDARY_ARRAYS: Final = ("critical_value", "bracket", "outcome", "status", "certified", "runs")


def boundary_arrays(boundary: Boundary) -> dict[str, NamedArray]:
    """Return the arrays of a boundary by name.

    Parameters
    ----------
    boundary : Boundary

    Returns
    -------
    dict of str to NamedArray
        The swept parameters by their paths, ascending, and over all of them those of `BOUNDARY_ARRAYS`.
        Text is written as numbers that the attribute ``flag_meanings`` explains.  What is not known is NaN.
    """
    swept, scene = boundary.swept, boundary.scene
    points = {boundary.place(point): point for point in boundary.points}
    axes = [sorted(set(values)) for values in zip(*points, strict=True)]
    shape = tuple(map(len, axes))

    def over(
        attributes: dict[str, Any], read: Callable[[BoundaryPoint], Sequence[float | None]], *ends: str
    ) -> NamedArray:
        unknown = [None] * (len(SIDES) if ends else 1)
        numbers = [read(points[at]) if at in points else unknown for at in product(*axes)]
        values = np.array(numbers, dtype=float)  # None becomes NaN
        return NamedArray((*swept, *ends), values.reshape((*shape, *(len(SIDES) for _ in ends))), attributes)

    outcomes = Flags.of(each for point in boundary.points for each in point.outcomes if each is not None)
    statuses = Flags.of(point.status for point in boundary.points)
    measure = parameter_attributes(scene, boundary.searched)
    coordinates = {
        parameter: NamedArray((parameter,), np.array(values), parameter_attributes(scene, parameter))
        for parameter, values in zip(swept, axes, strict=True)
    }
    return coordinates | {
        "critical_value": over(measure, lambda point: [point.critical_value]),
        "bracket": over(measure, lambda point: point.bracket, SIDE),
        "outcome": over(
            outcomes.attributes,
            lambda point: [None if each is None else outcomes.codes[each] for each in point.outcomes],
            SIDE,
        ),
        "status": over(statuses.attributes, lambda point: [statuses.codes[point.status]]),
        "certified": over({}, lambda point: [point.certified]),
        "runs": over({}, lambda point: [len(point.runs)]),
    }


def boundary_dataset(boundary: Boundary) -> xarray.Dataset:
    """Return a boundary as a data set over the values of its swept parameters.

    Parameters
    ----------
    boundary : Boundary

    Returns
    -------
    Dataset
        The arrays that `boundary_arrays` returns, with words instead of flags.  What is not known yet is NaN
        or empty.
    """
    from xarray import Dataset

    data = Dataset(
        coords={SIDE: list(SIDES)},
        attrs={"name": boundary.name, "study_key": boundary.study_key, "parameter": boundary.searched},
    )
    return data.assign({name: data_variable(array) for name, array in boundary_arrays(boundary).items()})
