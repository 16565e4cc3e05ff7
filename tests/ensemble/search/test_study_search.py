"""The sides of outcomes in a study."""

from __future__ import annotations

from ensemble.config.documents import load_study
from ensemble.search.critical_value import Side
from ensemble.search.study_search import side_of
from solver.analysis.run import Outcome

HAMAKER = load_study("critical-hamaker", ["search.scan=0"])


def test_sides_of_outcomes() -> None:
    assert {outcome: side_of(HAMAKER, outcome) for outcome in Outcome} == {
        Outcome.BOUND: Side.HIGH,
        Outcome.SEPARATED: Side.LOW,
        Outcome.FAILED: Side.FAILED,
        Outcome.UNDECIDED: Side.UNDECIDED,
        Outcome.END_TO_END: Side.UNDECIDED,
        Outcome.EQUILIBRIUM: Side.UNDECIDED,
        Outcome.STEADY: Side.UNDECIDED,
        Outcome.TUMBLING: Side.UNDECIDED,
        Outcome.COMPLETED: Side.UNDECIDED,
    }
    trap = load_study("critical-extension-rate")
    assert side_of(trap, Outcome.BOUND) is Side.LOW
    assert side_of(trap, Outcome.END_TO_END) is side_of(trap, Outcome.SEPARATED) is Side.HIGH
