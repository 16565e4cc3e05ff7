"""Results of what a section has planned."""

from __future__ import annotations

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Interval
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import Store
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Outcome, Run


class Results:
    """Reads the planned runs and boundaries from the store.

    Parameters
    ----------
    store : Store
        The store that holds them.
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    def summary(self, case: Case) -> RunSummary:
        """Return everything about a run except its arrays, also if the run failed.

        Parameters
        ----------
        case : Case
            A planned run.

        Returns
        -------
        RunSummary
            Its summary.
        """
        return self._store.summary(case.key)

    def run(self, case: Case) -> Run:
        """Return the whole run, also if it failed.

        Parameters
        ----------
        case : Case
            A planned run.

        Returns
        -------
        Run
            The run.
        """
        return self._store.load(case.key)

    def failed(self, case: Case) -> bool:
        """Return whether a run failed numerically and so says nothing about the physics.

        Parameters
        ----------
        case : Case
            A planned run.

        Returns
        -------
        bool
            True if it failed.
        """
        return self.summary(case).outcome is Outcome.FAILED

    def summary_of(self, key: str) -> RunSummary:
        """Return everything about the run with a key, for instance one behind a boundary.

        Parameters
        ----------
        key : str
            Key of the run.

        Returns
        -------
        RunSummary
            Its summary.
        """
        return self._store.summary(key)

    def boundary(self, case: StudyCase) -> Boundary:
        """Return the boundary of a study.

        Parameters
        ----------
        case : StudyCase
            A planned study.

        Returns
        -------
        Boundary
            The boundary that it has traced.
        """
        return self._store.boundary(case.study.key)

    def brackets(self, case: StudyCase) -> dict[float, Interval]:
        """Return the closed brackets of the boundary of a study.

        Parameters
        ----------
        case : StudyCase
            A planned study.

        Returns
        -------
        dict of float to (float, float)
            Brackets by the value of the swept parameter, in ascending order.
        """
        brackets: dict[float, Interval] = {}
        for swept, point in sorted(self.points(case).items()):
            low, high = point.bracket
            if low is not None and high is not None:
                brackets[swept] = (low, high)
        return brackets

    def points(self, case: StudyCase) -> dict[float, BoundaryPoint]:
        """Return the points of the boundary of a study.

        Parameters
        ----------
        case : StudyCase
            A planned study.

        Returns
        -------
        dict of float to BoundaryPoint
            Points by the value of the swept parameter.
        """
        return {point.parameters[case.study.swept[0]]: point for point in self.boundary(case).points}
