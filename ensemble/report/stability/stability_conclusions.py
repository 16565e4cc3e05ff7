"""What the stability report comes to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ensemble.report.stability.stability_document import (
    PairSymmetry,
    SceneVerdict,
    Stability,
    StabilityVerdict,
)

_ERRORS = {"global_error": "of positions", "area_error": "of areas", "spatial_error": "in space"}


def stability_conclusions(report: Stability) -> list[str]:
    """Return what the report comes to.

    Parameters
    ----------
    report : Stability
        The report as data.

    Returns
    -------
    list of str
        A sentence each, ten at most.
    """
    counts = {verdict: sum(row.verdict is verdict for row in report.rows) for verdict in StabilityVerdict}
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    raised = [row.scene for row in report.rows if row.run_key is None]
    broken = f"{len(raised)} runs broke: {', '.join(raised)}."
    return [
        f"{len(report.rows)} scenes: {verdicts}.",
        broken if raised else "Every run ended with an outcome or said why it failed.",
        *_largest_errors([row for row in report.rows if row.verdict is StabilityVerdict.FINE]),
        *_energy(report.rows),
        *_symmetry(report.pairs),
    ]


def _largest_errors(fine: Sequence[SceneVerdict]) -> Iterator[str]:
    """Yield the largest error of each kind that a fine run reports."""
    for field, kind in _ERRORS.items():
        known = [row for row in fine if getattr(row, field) is not None]
        if known:
            worst = max(known, key=lambda row: getattr(row, field))
            yield (
                f"Largest error {kind} that a fine run reports: {getattr(worst, field):.1e} ({worst.scene})."
            )


def _energy(rows: Sequence[SceneVerdict]) -> Iterator[str]:
    rises = [row for row in rows if row.verdict is StabilityVerdict.FINE and row.energy_rise is not None]
    if rises:
        worst = max(rises, key=lambda row: row.energy_rise or 0.0)
        yield f"At rest the energy of a fine run rises by {worst.energy_rise:.1e} at most ({worst.scene})."


def _symmetry(pairs: Sequence[PairSymmetry]) -> Iterator[str]:
    followed = [pair for pair in pairs if pair.growth_factor is not None]
    if followed:
        slowest = max(followed, key=lambda pair: pair.growth_factor or 0.0)
        stable = sum(bool(pair.stable) for pair in followed)
        yield (
            f"{stable} of {len(followed)} bound pairs in shear return to their symmetry: at worst a "
            f"difference changes by the factor {slowest.growth_factor:.1e} in a period ({slowest.scene})."
        )
    left_out = [pair for pair in pairs if pair.growth_factor is None]
    if left_out:
        yield f"Not followed: {'; '.join(f'{pair.scene} ({pair.reason})' for pair in left_out)}."
