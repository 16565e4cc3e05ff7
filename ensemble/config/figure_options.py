"""How the file of a figure is made."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated

from pydantic import Field

from solver.model import Model

_SIZE = re.compile(r"(\d+(?:\.\d*)?)\s*[x×]\s*(\d+(?:\.\d*)?)")
INCH = 2.54  # centimeters

# Called while a movie is drawn, with the number of pictures that are drawn and of all.
OnPicture = Callable[[int, int], None]

_Side = Annotated[float, Field(ge=3, le=100)]


class FigureOptions(Model):
    """How the file of a figure is made.

    Attributes
    ----------
    size : (float, float) or None
        Width and height in centimeters, from 3 to 100; None for those of the figure.  Letters keep theirs.
    dpi : int
        Points of a ``.png`` on an inch, from 30 to 1200.
    svg_text : bool
        Whether letters in an ``.svg`` are text, which programs can edit and search, but draw only where they
        have the fonts.  If not, they are curves.
    """

    size: tuple[_Side, _Side] | None = None
    dpi: int = Field(300, ge=30, le=1200)
    svg_text: bool = False


USUAL = FigureOptions()


def parse_size(text: str) -> tuple[float, float]:
    """Read a width and a height.

    Parameters
    ----------
    text : str
        Such as ``8.6x20``.

    Returns
    -------
    (float, float)

    Raises
    ------
    ValueError
        If it is none.
    """
    match = _SIZE.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"size: {text!r} — must be width x height in centimeters, such as 8.6x20")
    return float(match[1]), float(match[2])
