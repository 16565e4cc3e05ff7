"""The searches that a study describes: sides of outcomes, searches, certifications, and where to begin."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ensemble.config.study import Study
from ensemble.search.certification import Certification
from ensemble.search.critical_value import CriticalValueSearch, Side
from ensemble.search.scanning_search import ScanningSearch
from solver.analysis.run import Outcome

# A guess extends beyond the line through known neighbors by this share of the line's change from the nearest
# of them, because the boundary is curved, and by this many tolerances, because their brackets have a width.
CURVATURE_MARGIN = 0.1
BRACKET_MARGIN = 2.0

BracketSearch = CriticalValueSearch | ScanningSearch


def side_of(study: Study, outcome: Outcome) -> Side:
    """Return the side of the critical value on which an outcome lies.

    Parameters
    ----------
    study : Study
        The study that asks.
    outcome : Outcome
        Of one of its runs.

    Returns
    -------
    Side
        `Side.UNDECIDED` for an outcome that the study does not name: it does not answer the question.
    """
    if outcome in study.search.low:
        return Side.LOW
    if outcome in study.search.high:
        return Side.HIGH
    return Side.FAILED if outcome is Outcome.FAILED else Side.UNDECIDED


def critical_value_search(study: Study, guess: tuple[float, float] | None = None) -> BracketSearch:
    """Return a new search for one point of a study's boundary.

    Parameters
    ----------
    study : Study
        The study.
    guess : (float, float), optional
        Where the critical value is expected.

    Returns
    -------
    ScanningSearch or CriticalValueSearch
        The latter if the study does not scan.
    """
    search = study.search
    if search.scan:
        return ScanningSearch(search.grid, search.limits, search.scan, guess)
    return CriticalValueSearch(search.grid, search.limits, guess)


def certification_of(study: Study, bracket: tuple[float, float]) -> Certification:
    """Return a new certification of the bracket to which a search has converged.

    Parameters
    ----------
    study : Study
        The study.
    bracket : (float, float)
        Of the search.

    Returns
    -------
    Certification
    """
    return Certification(study.search.grid, study.search.limits, bracket)


def expected_bracket(
    study: Study, sweep_value: float, known: Mapping[float, tuple[float, float]]
) -> tuple[float, float] | None:
    """Return where the critical value is expected, from the points of the boundary that are known.

    With two or more points it is expected near the straight line through two neighbors, one on either side
    if possible.  With a single point the boundary is expected to lie between constant and proportional to the
    swept parameter.

    Parameters
    ----------
    study : Study
        The study.
    sweep_value : float
        Where the boundary is searched for.
    known : mapping from sweep value to bracket
        Points to which searches have converged.

    Returns
    -------
    (float, float) or None
        Two values within the limits.  While fewer than two points are known, the study's own guesses stand
        in for points; None if there are none either.
    """
    if len(known) < 2:
        known = {guess.at: guess.bracket for guess in study.search.guesses} | dict(known)
    if not known or sweep_value in known:
        return known.get(sweep_value)
    centers = {at: math.sqrt(low * high) for at, (low, high) in known.items()}
    nearest, *others = sorted(centers, key=lambda at: abs(at - sweep_value))
    if not others:
        ratio = sweep_value / nearest if nearest else 0.0
        spread = max(ratio, 1 / ratio) if ratio > 0 else 2.0  # proportionality means nothing across zero
        return _within_limits(study, centers[nearest] / spread, centers[nearest] * spread)
    on_other_side = (at for at in others if (at - sweep_value) * (nearest - sweep_value) < 0)
    other = next(on_other_side, others[0])
    slope = (centers[other] - centers[nearest]) / (other - nearest)
    change = slope * (sweep_value - nearest)
    center = _within_limits(study, centers[nearest] + change, math.inf)[0]
    low, high = known[nearest]
    width = max(BRACKET_MARGIN * study.search.tolerance, (high - low) / (high + low))
    margin = width * center + CURVATURE_MARGIN * abs(change)
    return _within_limits(study, center - margin, center + margin)


def _within_limits(study: Study, low: float, high: float) -> tuple[float, float]:
    first, last = study.search.limits
    return min(max(low, first), last), min(max(high, first), last)
