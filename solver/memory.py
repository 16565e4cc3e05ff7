"""What an object remembers of the past, as plain values that can be written down.

Each part of a run that remembers something names its attributes (`Remembering.memory`).  Plain values are
numbers, strings, None, arrays, and tuples, lists and dictionaries of such; a part of a part is a dictionary.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

Saved = dict[str, Any]


class Remembering:
    """Something whose attributes decide what it does next.

    Attributes
    ----------
    memory : tuple of str
        Names of the attributes that change while it is used: plain values, or `Remembering` themselves.
    """

    memory: ClassVar[tuple[str, ...]] = ()

    def saved(self) -> Saved:
        """Return what it remembers.

        Where several ranks share a run, this is collective, and all return the same.

        Returns
        -------
        dict
            Plain values by name; nothing that happens later changes them.

        Raises
        ------
        TypeError
            If an attribute is no plain value.
        """
        return {name: plain(getattr(self, name), name) for name in self.memory}

    def restore(self, saved: Saved) -> None:
        """Remember what another one of the same kind did; collective like `saved`.

        Parameters
        ----------
        saved : dict
            As `saved` returns it.
        """
        for name in self.memory:
            part = getattr(self, name, None)
            if isinstance(part, Remembering):
                part.restore(saved[name])
            else:
                setattr(self, name, plain(saved[name], name))


def plain(value: Any, name: str) -> Any:
    """Return a copy of a plain value.

    Parameters
    ----------
    value : object
    name : str
        Of the value, for messages.

    Returns
    -------
    object

    Raises
    ------
    TypeError
        If it is none.
    """
    if value is None or isinstance(value, (bool, int, float, str, np.generic)):
        return value
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, Remembering):
        return value.saved()
    if isinstance(value, dict):
        return {key: plain(each, name) for key, each in value.items()}
    if isinstance(value, list):
        return [plain(each, name) for each in value]
    if isinstance(value, tuple):
        return tuple(plain(each, name) for each in value)
    raise TypeError(f"{name}: {type(value).__name__} is no plain value, so it cannot be saved")
