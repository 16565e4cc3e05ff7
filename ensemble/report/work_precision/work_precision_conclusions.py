"""What the work-precision report comes to: which integrator, which tolerance, what error for what time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ensemble.report.work_precision.work_precision_document import (
    LeastTime,
    Measurement,
    WorkPrecision,
)
from ensemble.report.work_precision.work_precision_plan import default_method
from solver.scene import Numerics

_ERROR = 1e-3  # for which integrators are compared
_TOLERANCE: float = Numerics.model_fields["tolerance"].default


def work_precision_conclusions(report: WorkPrecision) -> list[str]:
    """Return what the report comes to.

    Parameters
    ----------
    report : WorkPrecision
        The report as data.

    Returns
    -------
    list of str
        A sentence each, ten at most.
    """
    times = [row for row in report.envelopes if row.error == _ERROR]
    return [
        *_integrators(report.envelopes),
        *(_at_one_error(row, report.measurements) for row in times),
        *_answers(report),
        *_reported(report),
    ]


def _integrators(envelopes: Sequence[LeastTime]) -> Iterator[str]:
    """Yield how the default compares with the fastest integrator over all scenes and errors."""
    slowdowns = [row.slowdown for row in envelopes if row.slowdown is not None]
    if slowdowns:
        worst = max((row for row in envelopes if row.slowdown is not None), key=lambda row: row.slowdown or 0)
        yield (
            f"The default integrator is the fastest at {sum(slow == 1 for slow in slowdowns)} of "
            f"{len(slowdowns)} errors, and takes {max(slowdowns):.2g} times as long as the fastest at worst "
            f"({worst.fastest}; {worst.scene}, error {worst.error:g})."
        )


def _at_one_error(row: LeastTime, measurements: Sequence[Measurement]) -> str:
    """Return the least times to an error in a scene, and with which numerics the default has its."""
    if row.default_seconds is None:
        return f"{row.scene}: {row.default}, the default, does not reach an error of {row.error:g}."
    best = next(
        each
        for each in measurements
        if each.scene == row.scene and each.method == row.default and each.wall_seconds == row.default_seconds
    )
    fastest = "the fastest" if row.fastest == row.default else f"{row.fastest} {row.fastest_seconds:.2g} s"
    return (
        f"{row.scene}, error {row.error:g}: {row.default}, the default, {row.default_seconds:.2g} s with "
        f"tolerance {best.tolerance:g} and {best.points} points; {fastest}."
    )


def _answers(report: WorkPrecision) -> Iterator[str]:
    """Yield the errors of the doublet's answers with the default integrator at the default tolerance."""
    default = default_method(2).name
    for answer in report.answers:
        if answer.method != default or answer.tolerance != _TOLERANCE or answer.period_error is None:
            continue
        yield (
            f"The doublet in shear with all defaults, in {answer.wall_seconds:.2g} s: error of the period "
            f"{answer.period_error:.1e}, of the viscosity {answer.viscosity_error or 0:.1e}."
        )


def _reported(report: WorkPrecision) -> Iterator[str]:
    """Yield how the errors that runs report compare with the true ones, where those can be trusted."""
    uncertainty = {row.scene: row.uncertainty for row in report.references}
    ratios = [
        each.error_reported / each.error_rms
        for each in report.measurements
        if each.error_reported is not None
        and each.error_rms is not None
        and each.error_rms > 10 * uncertainty[each.scene]
    ]
    if ratios:
        low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
        yield (
            f"Errors of positions that runs report are {middle:.2g} times the true ones in the median, "
            f"{low:.2g} to {high:.2g} times in nine of ten runs ({len(ratios)} runs)."
        )
