"""A published value, the computed one, and how far apart they are."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.report_model import Document

Value = float | tuple[float, float] | str | None
Bracket = tuple[float, float]

PERCENT = "%"


class Row(Document):
    """One line of a comparison.

    deviation : in `unit`; of brackets, the distance between them, 0 where they overlap.  None where one of
        the two is not known or they are words.
    allowed : largest deviation that counts as agreement; None where nothing was promised.
    agrees : whether it is kept; None without a promise.
    runs : keys of the runs behind the computed value.
    command : what computes it by itself.
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


def number(
    quantity: str,
    published: float | None,
    computed: float | None,
    behind: Sequence[Case] | StudyCase = (),
    *,
    allowed: float | None = None,
    unit: str = PERCENT,
    runs: Sequence[str] = (),
    note: str = "",
) -> Row:
    """Compare two numbers: relatively, in percent, or by their difference in another unit.

    Parameters
    ----------
    quantity : str
    published, computed : float or None
    behind : sequence of Case, or StudyCase
        What the computed number was read off.
    allowed : float, optional
        Largest deviation, in `unit`.
    unit : str
        ``"%"``, else the unit of both numbers, such as ``"°"``.
    runs : sequence of str
        Keys of the runs behind it, if they are not those of the cases.
    note : str
    """
    deviation = None
    if published is not None and computed is not None:
        deviation = 100 * (computed / published - 1) if unit == PERCENT else computed - published
    return _row(quantity, published, computed, deviation, behind, allowed, unit, runs, note)


def bracket(
    quantity: str,
    published: Bracket | None,
    computed: Bracket | None,
    behind: Sequence[Case] | StudyCase = (),
    *,
    allowed: float | None = None,
    runs: Sequence[str] = (),
    note: str = "",
) -> Row:
    """Compare two brackets: 0 where they overlap, else their distance in percent of the published end.

    The distance is negative where the computed bracket lies below.  Parameters as for `number`.
    """
    deviation = None
    if published is not None and computed is not None:
        deviation = 0.0
        if computed[0] > published[1]:
            deviation = 100 * (computed[0] / published[1] - 1)
        elif computed[1] < published[0]:
            deviation = 100 * (computed[1] / published[0] - 1)
    return _row(quantity, published, computed, deviation, behind, allowed, PERCENT, runs, note)


def words(
    quantity: str,
    published: str | None,
    computed: str | None,
    behind: Sequence[Case] | StudyCase = (),
    *,
    runs: Sequence[str] = (),
    note: str = "",
) -> Row:
    """Compare what happens, in words: they agree where they are the same."""
    row = _row(quantity, published, computed, None, behind, None, "", runs, note)
    same = None if published is None or computed is None else published == computed
    return row.model_copy(update={"agrees": same})


def _row(
    quantity: str,
    published: Value,
    computed: Value,
    deviation: float | None,
    behind: Sequence[Case] | StudyCase,
    allowed: float | None,
    unit: str,
    runs: Sequence[str],
    note: str,
) -> Row:
    cases = () if isinstance(behind, StudyCase) else behind
    commands = [behind.command] if isinstance(behind, StudyCase) else [case.command for case in cases]
    agrees = None if allowed is None or deviation is None else abs(deviation) <= allowed
    return Row(
        quantity=quantity,
        published=published,
        computed=computed,
        deviation=deviation,
        unit=unit,
        allowed=allowed,
        agrees=agrees,
        note=note,
        runs=list(runs) or [case.key for case in cases],
        command="; ".join(commands),
    )
