"""Reports on the solver that anyone can make again: error against run time, and stiff and extreme scenes.

The runs behind a report are kept in the store like any other, so a report that is interrupted resumes.
"""

from enum import StrEnum


class ReportName(StrEnum):
    """What can be reported."""

    WORK_PRECISION = "work-precision"
    STABILITY = "stability"
