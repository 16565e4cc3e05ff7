"""A published value, the computed one, and how far apart they are."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import Field

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.report_model import ReportModel

Interval = tuple[float, float]
Value = float | Interval | str | None

PERCENT = "%"


@cache
def published() -> dict[str, Any]:
    """Return the tables of ``published.toml``, which states the source of every value."""
    data = files("ensemble.report.paper") / "published.toml"
    return tomllib.loads(data.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Evidence:
    """What a computed value rests on.

    Attributes
    ----------
    runs : tuple of str
        Keys of the runs.
    command : str
        Command that computes the value; empty if there is no single one.
    """

    runs: tuple[str, ...] = ()
    command: str = ""


def runs_of(*cases: Case) -> Evidence:
    """Return the evidence that consists of the runs of some cases.

    Parameters
    ----------
    *cases : Case
        The cases.

    Returns
    -------
    Evidence
        Their keys and commands.
    """
    return Evidence(tuple(case.key for case in cases), "; ".join(case.command for case in cases))


def study_runs(study: StudyCase, runs: Sequence[str] = ()) -> Evidence:
    """Return the evidence that a study provides.

    Parameters
    ----------
    study : StudyCase
        The study.
    runs : sequence of str
        Keys of those of its runs on which the value rests.

    Returns
    -------
    Evidence
        The keys and the command of the study.
    """
    return Evidence(tuple(runs), study.command)


class Comparison(ReportModel):
    """A published value beside the computed one.

    Attributes
    ----------
    quantity : str
        What is compared.
    published, computed : float, (float, float), str or None
        The values: numbers, intervals, or words.  None where the value is not known.
    deviation : float or None
        Deviation of the computed value, in `unit`; of intervals, the distance between them, 0 where they
        overlap.  None where one of the two is not known, or for words.
    unit : str
        Unit of `deviation` and `allowed`.
    allowed : float or None
        Largest deviation that counts as agreement; None where no agreement is promised.
    agrees : bool or None
        Whether the deviation is allowed; None where no agreement is promised.
    note : str
        A remark.
    runs : list of str
        Keys of the runs on which the computed value rests.
    command : str
        Command that computes the value.
    """

    quantity: str
    published: Value = None
    computed: Value = None
    deviation: float | None = None
    unit: str = PERCENT
    allowed: float | None = None
    agrees: bool | None = None
    note: str = ""
    runs: list[str] = Field(default_factory=list)
    command: str = ""


def compare_numbers(
    quantity: str,
    published: float | None,
    computed: float | None,
    evidence: Evidence = Evidence(),
    *,
    allowed: float | None = None,
    unit: str = PERCENT,
    note: str = "",
) -> Comparison:
    """Compare two numbers, by their relative difference in percent or by their difference in another unit.

    Parameters
    ----------
    quantity : str
        What is compared.
    published, computed : float or None
        The numbers; None where one is not known.
    evidence : Evidence
        What the computed number rests on.
    allowed : float, optional
        Largest deviation that counts as agreement, in `unit`.
    unit : str
        ``"%"``, or the unit of both numbers, such as ``"°"``.
    note : str
        A remark.

    Returns
    -------
    Comparison
        The comparison.
    """
    deviation = None
    if published is not None and computed is not None:
        deviation = 100 * (computed / published - 1) if unit == PERCENT else computed - published
    return Comparison(
        quantity=quantity,
        published=published,
        computed=computed,
        deviation=deviation,
        unit=unit,
        allowed=allowed,
        agrees=_agree(deviation, allowed),
        note=note,
        runs=list(evidence.runs),
        command=evidence.command,
    )


def compare_intervals(
    quantity: str,
    published: Interval | None,
    computed: Interval | None,
    evidence: Evidence = Evidence(),
    *,
    allowed: float | None = None,
    note: str = "",
) -> Comparison:
    """Compare two brackets of a critical value.

    The deviation is 0 where they overlap, else the distance between them in percent of the published end.
    It is negative where the computed bracket lies below the published one.

    Parameters
    ----------
    quantity : str
        What is compared.
    published, computed : (float, float) or None
        The brackets, low end first; None where one is not known.
    evidence : Evidence
        What the computed bracket rests on.
    allowed : float, optional
        Largest deviation that counts as agreement, in percent.
    note : str
        A remark.

    Returns
    -------
    Comparison
        The comparison.
    """
    deviation = None
    if published is not None and computed is not None:
        deviation = 0.0
        if computed[0] > published[1]:
            deviation = 100 * (computed[0] / published[1] - 1)
        elif computed[1] < published[0]:
            deviation = 100 * (computed[1] / published[0] - 1)
    return Comparison(
        quantity=quantity,
        published=published,
        computed=computed,
        deviation=deviation,
        allowed=allowed,
        agrees=_agree(deviation, allowed),
        note=note,
        runs=list(evidence.runs),
        command=evidence.command,
    )


def compare_words(
    quantity: str,
    published: str | None,
    computed: str | None,
    evidence: Evidence = Evidence(),
    *,
    note: str = "",
) -> Comparison:
    """Compare what happens, in words: they agree if they are the same.

    Parameters
    ----------
    quantity : str
        What is compared.
    published, computed : str or None
        The words; None where one is not known.
    evidence : Evidence
        What the computed words rest on.
    note : str
        A remark.

    Returns
    -------
    Comparison
        The comparison; its unit is empty.
    """
    return Comparison(
        quantity=quantity,
        published=published,
        computed=computed,
        unit="",
        agrees=None if published is None or computed is None else published == computed,
        note=note,
        runs=list(evidence.runs),
        command=evidence.command,
    )


def _agree(deviation: float | None, allowed: float | None) -> bool | None:
    return None if allowed is None or deviation is None else abs(deviation) <= allowed
