"""Labels of runs: words by which the cells of a map are told apart.

To add a label, write a function from the answer of a run to a word without blanks, and register it with
`add_label`.  It may read the fields of `ensemble.search.task_queue.RunAnswer`.
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
        Takes the answer of a run and returns a word.

    Raises
    ------
    ValueError
        If the name is registered already.
    """
    LABELS.add(name)
    _FUNCTIONS[name] = label


def label_of(name: str, run: Any) -> str:
    """Return a label of a run.

    Parameters
    ----------
    name : str
        Of a registered label.
    run : RunAnswer

    Returns
    -------
    str
    """
    return _FUNCTIONS[name](run)


add_label("outcome", lambda run: str(run.outcome))
add_label("configuration", lambda run: str(run.configuration or run.outcome))
