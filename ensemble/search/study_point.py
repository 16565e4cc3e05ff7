"""One point of a study's boundary: its search, the confirmation of its ends, and its certification."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from ensemble.config.certifying_scene import can_be_certified, certifying_scene
from ensemble.config.study import Study
from ensemble.search.boundary import BoundaryPoint, Confirmed, OutcomeChange, Scanned
from ensemble.search.certification import Certification, CertificationResult
from ensemble.search.confirmation import CONFIRMING, Confirmation
from ensemble.search.critical_value import SearchStatus
from ensemble.search.point_search import PointSearch, SearchRun, SomeValueSearch
from ensemble.search.scanning_search import ScanningSearch
from ensemble.search.study_search import (
    BracketSearch,
    certification_of,
    counted,
    critical_value_search,
    side_of,
)
from ensemble.search.task_queue import RunAnswer
from solver.analysis.run import Configuration, Outcome
from solver.scene import Scene

ENDS = 2  # of a bracket, hence runs of a certification that finds both where they were


class StudyPoint:
    """The search at one place, with the confirmation and the certification of its bracket.

    When the search is done, the ends of brackets whose runs are sensitive are run again at finer numerics.
    When all of them are known, those that came out otherwise replace the former answers, and the search goes
    on from there.  So what it comes to follows from outcomes alone, not from their order.

    Parameters
    ----------
    study : Study
        What is to be traced.
    at : tuple of float
        Value of each swept parameter.
    known : callable
        Returns the answer of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    """

    def __init__(self, study: Study, at: tuple[float, ...], known: Callable[[str], RunAnswer | None]) -> None:
        self._study = study
        self._at = at
        self._known_run = known
        self._search: PointSearch[BracketSearch] = PointSearch(
            critical_value_search(study),
            at,
            partial(study.scene_at, at),
            partial(side_of, study),
            self._known,
        )
        self._confirmation = self._at_finer_numerics(Confirmation())
        self._certification: PointSearch[Certification] | None = None

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
        self._confirm()

    def next_task(self) -> SearchRun | None:
        """Return the task of the most useful value to try; None if there is none."""
        while not self._search.search.done:
            if (task := self._search.next_task()) is not None:
                return task
            if not self._search.search.done:
                return None
            self._confirm()
        if not self._confirmation.search.done:
            return self._confirmation.next_task()
        certification = self._certifying()
        return None if certification is None else certification.next_task()

    def answer(self, task: SearchRun, answer: RunAnswer) -> None:
        """Take the answer of a task's run.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """
        self._owner(task).answer(task, counted(answer, self._study.search.sides))
        self._confirm()

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
        return self._is_confirmed and (certification is None or certification.search.done)

    @property
    def pending(self) -> int:
        """How many tasks are handed out."""
        return sum(len(search.pending) for search in self._searches)

    @property
    def urgency(self) -> tuple[bool, bool, int]:
        """How useful the next task is compared with those of other points: the least comes first.

        Runs that are needed in any case come first, among them those of points without a task, and then
        those at finer numerics.

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
        return sum(search.known_answers for search in self._searches)

    @property
    def runs_left(self) -> float:
        """How many more answers are expected to be needed."""
        if not self._is_confirmed:
            finer = self._confirmation.search.values_left + (ENDS if self._study.search.certify else 0)
            return self._search.search.answers_left + finer
        certification = self._certifying()
        return 0 if certification is None else certification.search.ends_left

    def boundary_point(self) -> BoundaryPoint:
        """Return the point as far as it is known."""
        search, certification = self._search.search, self._certifying()
        confirming = search.done and not self._is_confirmed
        bracket, status = search.bracket, CONFIRMING if confirming else str(search.status)
        outcomes, certified_by = self._outcomes(bracket), None
        runs = self._search.runs + self._confirmation.runs
        if certification is not None:
            result, ends = certification.search.result, certification.search.bracket
            status, runs = str(result), runs + certification.runs
            if ends is not None:
                bracket, outcomes = ends, certification.outcomes(ends)
                if result is CertificationResult.CONVERGED:
                    certified_by = certifying_scene(self._study.scene_at(self._at, ends[0])).numerics
        return BoundaryPoint(
            parameters=dict(zip(self._study.swept, self._at, strict=True)),
            bracket=bracket,
            outcomes=outcomes,
            status=status,
            changes=list(map(self._change, search.changes)),
            incidental_changes=list(map(self._change, search.incidental_changes)),
            scanned=_scanned(search),
            confirmed=[
                Confirmed(
                    value=value,
                    outcome=self._search.answer_at(value).outcome,
                    finer_outcome=self._confirmation.answer_at(value).outcome,
                )
                for value in sorted(self._confirmation.search.sides)
            ],
            certified=certified_by is not None,
            certified_by=certified_by,
            runs=list(dict.fromkeys(runs)),  # one that has confirmed an end may certify it, too
        )

    @property
    def searched_bracket(self) -> tuple[float, float] | None:
        """The bracket of the search, if it has converged, confirmed or not: it leads to guesses elsewhere."""
        search = self._search.search
        low, high = search.bracket if search.status is SearchStatus.CONVERGED else (None, None)
        return None if low is None or high is None else (low, high)

    @property
    def converged_bracket(self) -> tuple[float, float] | None:
        """The bracket of the search, if it has converged and its ends are confirmed."""
        return self.searched_bracket if self._is_confirmed else None

    def _certifying(self) -> PointSearch[Certification] | None:
        """Return the certification of a search that has converged, beginning it if it is new."""
        bracket = self.converged_bracket if self._study.search.certify else None
        if bracket is None:
            return None
        if self._certification is None:
            self._certification = self._at_finer_numerics(certification_of(self._study, bracket))
            self._certification.adopt(self._confirmation)
            self._certification.take_all_known()
        return self._certification

    @property
    def _is_confirmed(self) -> bool:
        """Whether the search is done, and its sensitive ends have come out the same at finer numerics."""
        return self._search.search.done and self._confirmation.search.done

    def _confirm(self) -> None:
        """See to it that the sensitive ends are confirmed; go on where finer runs came out otherwise."""
        search, confirmation = self._search.search, self._confirmation.search
        while search.done:
            for value in search.ends_of_changes - confirmation.values:
                scene = self._study.scene_at(self._at, value)
                if self._search.answer_at(value).sensitive and can_be_certified(scene):
                    confirmation.add(value)
                    self._confirmation.take_known(value)
            contrary = {
                value: side for value, side in confirmation.sides.items() if side is not search.side_at(value)
            }
            if not (contrary and confirmation.done):
                return
            search.revise(contrary)

    def _finer_scene(self, value: float) -> Scene:
        return certifying_scene(self._study.scene_at(self._at, value))

    def _at_finer_numerics(self, search: SomeValueSearch) -> PointSearch[SomeValueSearch]:
        side = partial(side_of, self._study)
        return PointSearch(search, self._at, self._finer_scene, side, self._known)

    def _change(self, ends: tuple[float, float]) -> OutcomeChange:
        return OutcomeChange.model_validate({"bracket": ends, "outcomes": self._outcomes(ends)})

    def _outcomes(self, ends: tuple[float | None, float | None]) -> tuple[str | None, str | None]:
        """Return the outcomes that count at two values; None for an end that is unknown."""
        low, high = (None if end is None else self._outcome(end) for end in ends)
        return low, high

    def _known(self, key: str) -> RunAnswer | None:
        answer = self._known_run(key)
        return answer and counted(answer, self._study.search.sides)

    def _outcome(self, value: float) -> Outcome | Configuration:
        is_finer = value in self._confirmation.search.sides
        return (self._confirmation if is_finer else self._search).answer_at(value).outcome

    @property
    def _searches(self) -> tuple[PointSearch[Any], ...]:
        """All that hand out tasks."""
        certification = () if self._certification is None else (self._certification,)
        return (self._search, self._confirmation, *certification)

    def _owner(self, task: SearchRun) -> PointSearch[Any]:
        latest_first = reversed(self._searches)
        return next((each for each in latest_first if each.pending.get(task.value) == task), self._search)


def _scanned(search: BracketSearch) -> Scanned | None:
    if not isinstance(search, ScanningSearch) or search.widest_unseen is None:
        return None
    looked_at = list(search.looked_at)
    return Scanned(values=len(looked_at), looked_at=looked_at, widest_unseen=search.widest_unseen)
