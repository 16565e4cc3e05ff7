"""Reports that anyone can make again: on the solver, and the paper recomputed.

The runs behind a report are kept in the store like any other, so a report that is interrupted resumes.
"""

from enum import StrEnum
from pathlib import Path
from typing import Final

PAGE: Final = "report.html"
_REPORTS = "reports"  # directory in a store


class ReportName(StrEnum):
    """What can be reported."""

    WORK_PRECISION = "work-precision"
    STABILITY = "stability"
    SCALING = "scaling"
    PAPER = "paper"


def report_directory(store: Path, name: ReportName) -> Path:
    """Return the directory that holds the files of a report.

    Parameters
    ----------
    store : Path
        Directory of the store that keeps the report.
    name : ReportName
        Name of the report.

    Returns
    -------
    Path
        It may not exist yet.
    """
    return store / _REPORTS / name
