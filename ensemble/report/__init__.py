"""Reports that anyone can make again: on the solver, and the paper recomputed.

The runs behind a report are kept in the store like any other, so a report that is interrupted resumes.
"""

from enum import StrEnum


class ReportName(StrEnum):
    """What can be reported."""

    WORK_PRECISION = "work-precision"
    STABILITY = "stability"
    SCALING = "scaling"
    PAPER = "paper"
