"""The searches that a study describes: sides of outcomes, searches, certifications."""

from __future__ import annotations

from collections.abc import Collection

from ensemble.config.study import Study
from ensemble.search.certification import Certification
from ensemble.search.critical_value import CriticalValueSearch, Side
from ensemble.search.scanning_search import ScanningSearch
from ensemble.search.task_queue import RunAnswer
from solver.analysis.run import Configuration, Outcome

BracketSearch = CriticalValueSearch | ScanningSearch


def counted(answer: RunAnswer, asked: Collection[str]) -> RunAnswer:
    """Return an answer as a study counts it: a configuration that it asks for takes the place of the outcome.

    Parameters
    ----------
    answer : RunAnswer
        Of a run of the study.
    asked : collection of str
        The names on both sides of the boundary.

    Returns
    -------
    RunAnswer
    """
    if answer.configuration is None or answer.configuration not in asked:
        return answer
    return answer._replace(outcome=answer.configuration)


def side_of(study: Study, outcome: Outcome | Configuration) -> Side:
    """Return the side of the critical value on which an outcome lies.

    Parameters
    ----------
    study : Study
        The study that asks.
    outcome : Outcome or Configuration
        Of one of its runs, as it is `counted`.

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
