"""A map as arrays over the values of its two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ensemble.search.map_record import MapRecord
from ensemble.store.flagged_text import Flags, data_variable
from ensemble.store.run_record import NamedArray, parameter_attributes

if TYPE_CHECKING:
    import xarray

# What every map has as arrays over the parameters.
MAP_ARRAYS: Final = ("label", "made")


def map_arrays(record: MapRecord) -> dict[str, NamedArray]:
    """Return the arrays of a map by name.

    Parameters
    ----------
    record : MapRecord

    Returns
    -------
    dict of str to NamedArray
        The two parameters by their paths, in the middles of the cells, and over both of them ``label``, whose
        attribute ``flag_meanings`` explains the numbers, and ``made``, 1 where a cell was run.
    """
    axes, scene = record.question.axes, record.scene
    dimensions = tuple(axis.parameter for axis in axes)
    made = np.zeros(record.numbers.shape)
    for each in record.runs:
        made[each.cell] = 1.0
    coordinates = {
        axis.parameter: NamedArray(
            (axis.parameter,), np.array(axis.values), parameter_attributes(scene, axis.parameter)
        )
        for axis in axes
    }
    # The words are sorted in a record, too, so their numbers are the same.
    label = NamedArray(dimensions, record.numbers.astype(float), Flags.of(record.labels).attributes)
    return coordinates | {"label": label, "made": NamedArray(dimensions, made)}


def map_dataset(record: MapRecord) -> xarray.Dataset:
    """Return a map as a data set over the values of its two parameters.

    Parameters
    ----------
    record : MapRecord

    Returns
    -------
    Dataset
        The arrays that `map_arrays` returns, with words instead of numbers of labels.
    """
    from xarray import Dataset

    variables = {name: data_variable(array) for name, array in map_arrays(record).items()}
    return Dataset(variables, attrs={"name": record.name, "key": record.key})
