"""Arrays of words as arrays of numbers, whose attributes say after the CF conventions what they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ensemble.store.run_record import NamedArray
from solver.analysis.run import Array

_FLAGS: Final = "flag_values"
_MEANINGS: Final = "flag_meanings"


class Flags(NamedTuple):
    """The numbers that stand for words.

    Attributes
    ----------
    codes : mapping of str to float
        By word.
    attributes : dict
        Of the array.
    """

    codes: Mapping[str, float]
    attributes: dict[str, Any]

    @classmethod
    def of(cls, words: Iterable[str]) -> Self:
        """Give each word a number.

        Parameters
        ----------
        words : iterable of str
            Without blanks; they may repeat.

        Returns
        -------
        Flags
        """
        codes = {word: float(number) for number, word in enumerate(sorted(set(words)))}
        return cls(codes, {_FLAGS: list(codes.values()), _MEANINGS: " ".join(codes)})


def data_variable(array: NamedArray) -> tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]:
    """Return what xarray takes for an array: with words instead of the numbers that stand for them.

    Parameters
    ----------
    array : NamedArray

    Returns
    -------
    dimensions : tuple of str
    values : array
    attributes : dict
    """
    words = words_of(array.values[:], array.attributes)
    return array.dimensions, array.values[:] if words is None else words, array.attributes


def words_of(values: Array, attributes: Mapping[str, Any]) -> NDArray[Any] | None:
    """Return the words that the numbers of an array stand for.

    Parameters
    ----------
    values : array
        NaN for none.
    attributes : mapping
        Of the array.

    Returns
    -------
    array of str or None
        Empty text where there is none; None if the numbers are no flags.
    """
    if _MEANINGS not in attributes:
        return None
    words = np.array([*attributes[_MEANINGS].split(), ""])
    return words[np.where(np.isnan(values), len(words) - 1, values).astype(int)]
