"""Writing a figure to a file."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from ensemble.figures.style import STYLE

# What a format would date its files with, blanked so that equal figures are equal files.
_UNDATED = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format that the file's suffix names.

    The file appears complete or not at all, replacing an earlier one, and equal figures give equal bytes.

    Parameters
    ----------
    figure : Figure
    path : Path
        Ends in ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    ValueError
        For any other suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in _UNDATED:
        *others, last = _UNDATED
        raise ValueError(f"output: must end in {', '.join(others)} or {last}, got {path.name!r}")
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with matplotlib.rc_context(STYLE):
            figure.savefig(unfinished, format=suffix[1:], metadata=_UNDATED[suffix])
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
