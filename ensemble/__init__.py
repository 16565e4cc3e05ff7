"""Boundaries between outcomes: studies, searches, MPI ranks, the store, figures, reports, the command line.

`README.md` beside this file is the guide.  Names are imported on first use: importing the package loads
nothing.

The parts, from the lowest to the highest. Each imports only parts that stand before it, and `solver`; a test
checks this.

1. `errors`, `interrupts`, `timestamp`, `disk`: what all parts need
2. `config`: documents, presets, changes by dotted path, keys of runs
3. `search`: which run is the most useful one to make next; no MPI, no files
4. `store`: runs and boundaries on disk
5. `mpi`: runs on groups of ranks
6. `display`: progress and tables
7. `figures`: phase diagrams, runs, movies
8. `report`: reports on the solver, and the paper recomputed
9. `questions`: kinds of question, one module each: cost, how it is answered, how the answer is shown
10. `cli`: the command line
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ensemble.config.documents import load_scene, load_study
    from ensemble.store.store import Store

__all__ = ["Store", "load_scene", "load_study"]

_MODULES = {"Store": "store.store", "load_scene": "config.documents", "load_study": "config.documents"}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
