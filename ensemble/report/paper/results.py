"""What has been run for a section."""

from __future__ import annotations

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Bracket
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import Store
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Outcome, Run


class Results:
    """Reads the runs and boundaries that were planned from the store.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    def summary(self, case: Case) -> RunSummary:
        """Everything about a run except its arrays, also if it failed."""
        return self._store.summary(case.key)

    def run(self, case: Case) -> Run:
        """The whole run, also if it failed."""
        return self._store.load(case.key)

    def failed(self, case: Case) -> bool:
        """Whether the run failed numerically: it then says nothing about the physics."""
        return self.summary(case).outcome is Outcome.FAILED

    def summary_of(self, key: str) -> RunSummary:
        """Everything about the run with this key, for instance one behind a boundary."""
        return self._store.summary(key)

    def boundary(self, case: StudyCase) -> Boundary:
        """The boundary of a study."""
        return self._store.boundary(case.study.key)

    def brackets(self, case: StudyCase) -> dict[float, Bracket]:
        """The closed brackets of a study's boundary by the value of the sweep, in ascending order."""
        found: dict[float, Bracket] = {}
        for at, point in sorted(self.points(case).items()):
            low, high = point.bracket
            if low is not None and high is not None:
                found[at] = (low, high)
        return found

    def points(self, case: StudyCase) -> dict[float, BoundaryPoint]:
        """The points of a study's boundary by the value of the sweep."""
        return {point.parameters[case.study.sweep.parameter]: point for point in self.boundary(case).points}
