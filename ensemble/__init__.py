"""Boundaries between outcomes: studies, searches, MPI ranks, the store, figures, reports, the command line.

`README.md` beside this file is the guide.  Names are imported on first use: importing the package loads
nothing.
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
