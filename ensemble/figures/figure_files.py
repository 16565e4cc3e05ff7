"""Figures as files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Final

import matplotlib
from matplotlib.figure import Figure

from ensemble.config.figure_options import INCH, USUAL, FigureOptions
from ensemble.disk import replacing
from ensemble.figures.style import STYLE, WIDTH

# The metadata that hold the date of a file are left out, so that equal figures are equal files.
_UNDATED = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}

NO_ROOM: Final = "constrained_layout not applied"  # how the warning of the library begins

FIGURE_SUFFIXES: Final = tuple(_UNDATED)


def save(figure: Figure, path: Path, options: FigureOptions = USUAL) -> None:
    """Write a figure in the format that the file's suffix names.

    The file appears complete or not at all, replacing an earlier one, and equal figures give equal bytes.

    Parameters
    ----------
    figure : Figure
    path : Path
        Its suffix is ``.png``, ``.svg`` or ``.pdf``.
    options : FigureOptions
        Its size is given to the figure.

    Raises
    ------
    ValueError
        For any other suffix, or if the figure has no room for its letters.
    """
    suffix = suffix_among(path, FIGURE_SUFFIXES)
    image = BytesIO()  # a disk may take only a part, which not every format can end
    if options.size is not None:
        width, height = options.size
        figure.set_size_inches((width / INCH, height / INCH))
    with matplotlib.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("error", NO_ROOM)
        matplotlib.rcParams["svg.fonttype"] = "none" if options.svg_text else "path"
        try:
            figure.savefig(image, format=suffix[1:], dpi=options.dpi, metadata=_UNDATED[suffix])
        except UserWarning as warning:
            width, height = figure.get_size_inches() * INCH
            raise ValueError(
                f"size: {width:.4g}x{height:.4g} is too small for the letters of this figure"
            ) from warning
    with replacing(path) as unfinished:
        unfinished.write_bytes(image.getbuffer())


def width_of(options: FigureOptions) -> float:
    """Return the width that a figure is made for.

    Parameters
    ----------
    options : FigureOptions

    Returns
    -------
    float
        Inches.
    """
    return WIDTH if options.size is None else options.size[0] / INCH


def suffix_among(path: Path, suffixes: Sequence[str]) -> str:
    """Return the suffix of a file in lower case, and check it.

    Parameters
    ----------
    path : Path
    suffixes : sequence of str
        The suffixes that are allowed, at least two.

    Returns
    -------
    str
        One of ``suffixes``.

    Raises
    ------
    ValueError
        If the suffix is not allowed.
    """
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        *others, last = suffixes
        raise ValueError(f"output: must end in {', '.join(others)} or {last}, got {path.name!r}")
    return suffix
