"""One point of a study's boundary: its search and, once that has converged, its certification."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.study import Study
from ensemble.search.boundary import BoundaryPoint, OutcomeChange, Scanned
from ensemble.search.certification import Certification, CertificationResult
from ensemble.search.critical_value import SearchStatus
from ensemble.search.point_search import PointSearch, SearchRun
from ensemble.search.scanning_search import ScanningSearch
from ensemble.search.study_search import BracketSearch, certification_of, critical_value_search, side_of
from solver.analysis.run import Outcome

ENDS = 2  # of a bracket, hence runs of a certification that finds both where they were


class StudyPoint:
    """The search at one value of a sweep, and the certification of its bracket.

    Parameters
    ----------
    study : Study
        What is to be traced.
    sweep_value : float
        Of the swept parameter.
    known : callable
        Returns the outcome of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    """

    def __init__(self, study: Study, sweep_value: float, known: Callable[[str], Outcome | None]) -> None:
        self._study = study
        self._sweep_value = sweep_value
        self._known = known
        self._search: PointSearch[BracketSearch] = PointSearch(
            critical_value_search(study),
            sweep_value,
            partial(study.scene_at, sweep_value),
            partial(side_of, study),
            known,
        )
        self._certification: PointSearch[Certification] | None = None

    @property
    def is_new(self) -> bool:
        """Whether no answer is known and no task is handed out."""
        return self._search.is_new

    def replace_guess(self, guess: tuple[float, float]) -> None:
        """Say where the critical value is expected.

        Parameters
        ----------
        guess : (float, float)
            Two values.
        """
        self._search.search.replace_guess(guess)

    def take_known(self, value: float) -> None:
        """Take the answer for a value if its run has been made before.

        Parameters
        ----------
        value : float
            That the search may try.
        """
        self._search.take_known(value)

    def next_task(self) -> SearchRun | None:
        """Return the task of the most useful value to try; None if there is none."""
        while not self._search.search.done:
            if (task := self._search.next_task()) is not None:
                return task
            if not self._search.search.done:
                return None
        certification = self._certifying()
        return None if certification is None else certification.next_task()

    def answer(self, task: SearchRun, outcome: Outcome) -> None:
        """Take the outcome of a task's run.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        outcome : Outcome
            Of its run.
        """
        self._owner(task).answer(task, outcome)

    def cancelled(self, task: SearchRun) -> None:
        """Take back a task whose run was cancelled.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        """
        self._owner(task).cancelled(task)

    def unneeded_tasks(self) -> tuple[SearchRun, ...]:
        """Return the tasks that are handed out and whose outcome is no longer needed."""
        unneeded = self._search.unneeded_tasks()
        if self._certification is None:
            return unneeded
        # A late answer may have shown that there is no single critical value, hence nothing to certify.
        abandoned = self.converged_bracket is None
        pending = self._certification.pending.values()
        return (*unneeded, *(pending if abandoned else self._certification.unneeded_tasks()))

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""
        certification = self._certifying()
        return self._search.search.done and (certification is None or certification.search.done)

    @property
    def pending(self) -> int:
        """How many tasks are handed out."""
        certifying = 0 if self._certification is None else len(self._certification.pending)
        return len(self._search.pending) + certifying

    @property
    def urgency(self) -> tuple[bool, bool, int]:
        """How useful the next task is compared with those of other points: the least comes first.

        Runs that are needed in any case come first, among them those of points without a task, and then
        those of certifications.

        Returns
        -------
        (bool, bool, int)
        """
        if self._search.search.done:
            return False, self.pending > 0, 0
        return not self._search.search.has_certain, self.pending > 0, self.pending

    @property
    def known_answers(self) -> int:
        """How many outcomes come from runs made before."""
        certified = 0 if self._certification is None else self._certification.known_answers
        return self._search.known_answers + certified

    @property
    def runs_left(self) -> float:
        """How many more answers are expected to be needed."""
        if not self._search.search.done:
            return self._search.search.answers_left + (ENDS if self._study.search.certify else 0)
        certification = self._certifying()
        return 0 if certification is None else certification.search.ends_left

    def boundary_point(self) -> BoundaryPoint:
        """Return the point as far as it is known."""
        search, certification = self._search.search, self._certifying()
        bracket, status, runs = search.bracket, str(search.status), self._search.runs
        outcomes, certified_by = self._search.outcomes(bracket), None
        if certification is not None:
            result, ends = certification.search.result, certification.search.bracket
            status, runs = str(result), runs + certification.runs
            if ends is not None:
                bracket, outcomes = ends, certification.outcomes(ends)
                if result is CertificationResult.CONVERGED:
                    certified_by = certifying_scene(self._study.scene_at(self._sweep_value, ends[0])).numerics
        return BoundaryPoint(
            parameters={self._study.sweep.parameter: self._sweep_value},
            bracket=bracket,
            outcomes=outcomes,
            status=status,
            changes=[
                OutcomeChange.model_validate({"bracket": change, "outcomes": self._search.outcomes(change)})
                for change in search.changes
            ],
            scanned=_scanned(search),
            certified=certified_by is not None,
            certified_by=certified_by,
            runs=runs,
        )

    @property
    def converged_bracket(self) -> tuple[float, float] | None:
        """The bracket of the search, if it has converged."""
        search = self._search.search
        low, high = search.bracket if search.status is SearchStatus.CONVERGED else (None, None)
        return None if low is None or high is None else (low, high)

    def _certifying(self) -> PointSearch[Certification] | None:
        """Return the certification of a search that has converged, beginning it if it is new."""
        bracket = self.converged_bracket if self._study.search.certify else None
        if bracket is None:
            return None
        if self._certification is None:
            self._certification = PointSearch(
                certification_of(self._study, bracket),
                self._sweep_value,
                lambda value: certifying_scene(self._study.scene_at(self._sweep_value, value)),
                partial(side_of, self._study),
                self._known,
            )
            self._certification.take_all_known()
        return self._certification

    def _owner(self, task: SearchRun) -> PointSearch[BracketSearch] | PointSearch[Certification]:
        certification = self._certification
        if certification is not None and certification.pending.get(task.value) == task:
            return certification
        return self._search


def _scanned(search: BracketSearch) -> Scanned | None:
    if not isinstance(search, ScanningSearch) or search.widest_unseen is None:
        return None
    looked_at = list(search.looked_at)
    return Scanned(values=len(looked_at), looked_at=looked_at, widest_unseen=search.widest_unseen)
