"""Diagnostics of a run over time, as JSON can hold them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from api.http.schemas import SeriesDocument
from ensemble.errors import BadInput
from solver.analysis.run import Array, Run


def finite_or_none(values: Array) -> Any:
    """Turn an array into nested lists, with None for what JSON has no word for."""
    words = values.astype(object)
    words[~np.isfinite(values)] = None
    return words.tolist()


def series_document(run: Run, names: Sequence[str]) -> SeriesDocument:
    """Choose diagnostics by name, all without names.

    Raises
    ------
    BadInput
        If the run has none of a name.
    """
    unknown = set(names) - run.series.keys()
    if unknown:
        raise BadInput(f"name: {min(unknown)!r} — must be one of {', '.join(sorted(run.series))}")
    chosen = sorted(set(names) or run.series.keys())
    return SeriesDocument(series={name: finite_or_none(run.series[name]) for name in chosen})
