"""Labels of runs: words by which the cells of a map are told apart.

To add a label, write a function from the results of a run to a word without blanks, which reads only fields
that a stored summary has, too, and register it with `add_label`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from solver.registry import RegisteredNames

LABELS: Final = RegisteredNames()

_FUNCTIONS: Final[dict[str, Callable[[Any], str]]] = {}


def add_label(name: str, label: Callable[[Any], str]) -> None:
    """Register a label.

    Parameters
    ----------
    name : str
        By which documents name it.
    label : callable
        Takes the results of a run, or their summary in a store, and returns a word.

    Raises
    ------
    ValueError
        If the name is registered already.
    """
    LABELS.add(name)
    _FUNCTIONS[name] = label


def labels_of(run: Any) -> dict[str, str]:
    """Return all labels of a run.

    Parameters
    ----------
    run : RunResults
        Or anything with the same fields.

    Returns
    -------
    dict of str to str
        By name.
    """
    return {name: _FUNCTIONS[name](run) for name in LABELS}


add_label("outcome", lambda run: str(run.outcome))
