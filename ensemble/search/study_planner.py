"""Decides which run of a study is the most useful one to make next.  Pure: no MPI, no files, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.dotted_paths import parameter_value
from ensemble.config.study import Study
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.certification import Certification, CertificationResult
from ensemble.search.critical_value import CriticalValueSearch, SearchStatus
from ensemble.search.point_search import PointSearch, SearchRun
from ensemble.search.study_search import (
    certification_of,
    critical_value_search,
    expected_bracket,
    side_of,
)
from ensemble.timestamp import now
from solver.analysis.run import Outcome
from solver.scene import Scene

_AnyPointSearch = PointSearch[CriticalValueSearch] | PointSearch[Certification]

ENDS = 2  # of a bracket, hence runs of a certification that finds both where they were


class StudyPlanner:
    """The task queue of a study: all of its searches and the certifications of their brackets.

    Searches are worked on in the order of the sweep, one task each before any gets a second one: two workers
    get further on two searches than on one, and finished searches show the later ones where to begin.  When
    there are more workers than searches left, several values of one search are tried at once.  Certifications
    come before that, because their runs are needed whatever the others come to.

    Parameters
    ----------
    study : Study
        What is to be traced.
    known : callable
        Returns the outcome of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    made : iterable of Scene
        Scenes of runs made before.  Those that belong to this study are answers from the start.
    """

    def __init__(
        self, study: Study, known: Callable[[str], Outcome | None], made: Iterable[Scene] = ()
    ) -> None:
        self._study = study
        self._known = known
        grid = study.search.grid
        self._values = {grid.value(index) for index in grid.within(*study.search.limits)}
        self._searches = {
            at: PointSearch(
                critical_value_search(study), at, partial(study.scene_at, at), partial(side_of, study), known
            )
            for at in study.sweep.values
        }
        self._certifications: dict[float, PointSearch[Certification]] = {}
        for at, value in set(filter(None, map(self._place, made))):
            self._searches[at].take_known(value)

    def next_task(self) -> SearchRun | None:
        """See `TaskQueue`."""
        return next((task for task in map(self._next_of, self._by_usefulness()) if task is not None), None)

    def answer(self, task: SearchRun, outcome: Outcome) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        outcome : Outcome
            Of its run.
        """
        self._point_search_of(task).answer(task, outcome)

    def cancelled(self, task: SearchRun) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        """
        self._point_search_of(task).cancelled(task)

    def unneeded_tasks(self) -> tuple[SearchRun, ...]:
        """See `TaskQueue`."""
        needed = list(self._point_searches())
        # A late answer may have shown that there is no single critical value, hence nothing to certify.
        abandoned = [
            point_search for point_search in self._certifications.values() if point_search not in needed
        ]
        return (
            *(task for point_search in needed for task in point_search.unneeded_tasks()),
            *(task for point_search in abandoned for task in point_search.pending.values()),
        )

    @property
    def done(self) -> bool:
        """Whether no search and no certification needs a further answer."""
        return all(point_search.search.done for point_search in self._point_searches())

    @property
    def known_answers(self) -> int:
        """See `TaskQueue`."""
        return sum(point_search.known_answers for point_search in self._point_searches())

    @property
    def runs_left(self) -> float:
        """How many more answers are needed if each halves a bracket or certifies an end of one."""
        searching = [at for at, search in self._searches.items() if not search.search.done]
        ends = sum(certification.search.ends_left for certification in self._certifying())
        if self._study.search.certify:
            ends += ENDS * len(searching)
        return sum(map(self._halvings, searching)) + ends

    def boundary(self) -> Boundary:
        """Return the boundary as far as it is known."""
        return Boundary(
            study_key=self._study.key,
            study=self._study.model_dump(mode="json"),
            name=self._study.name,
            points=[self._point(at) for at in self._study.sweep.values],
            updated=now(),
        )

    def _place(self, scene: Scene) -> tuple[float, float] | None:
        """Return the place in the study of a run of this scene; None if it is not one of the study's."""
        try:
            at = parameter_value(scene, self._study.sweep.parameter)
            value = parameter_value(scene, self._study.search.parameter)
        except ValueError:  # a scene of another kind
            return None
        return (at, value) if at in self._searches and value in self._values else None

    def _by_usefulness(self) -> Iterator[_AnyPointSearch]:
        """Give all searches and certifications, the one whose next task is the most useful first."""
        # Sorting is stable: among equally busy searches the order of the sweep holds.
        searches = sorted(self._searches.values(), key=lambda search: len(search.pending))
        yield from (search for search in searches if not search.pending)
        yield from self._certifying()
        yield from (search for search in searches if search.pending)
        # Known answers may have ended a search on the way here.
        yield from self._certifying()

    def _next_of(self, point_search: _AnyPointSearch) -> SearchRun | None:
        if isinstance(point_search.search, CriticalValueSearch) and point_search.is_new:
            guess = expected_bracket(self._study, point_search.sweep_value, self._converged())
            if guess is not None:
                point_search.search.replace_guess(guess)
        return point_search.next_task()

    def _point_searches(self) -> Iterator[_AnyPointSearch]:
        yield from self._searches.values()
        yield from self._certifying()

    def _point_search_of(self, task: SearchRun) -> _AnyPointSearch:
        certification = self._certifications.get(task.sweep_value)
        if certification is not None and task in certification.pending.values():
            return certification
        return self._searches[task.sweep_value]

    def _certifying(self) -> list[PointSearch[Certification]]:
        every = map(self._certification, self._searches)
        return [certification for certification in every if certification is not None]

    def _certification(self, at: float) -> PointSearch[Certification] | None:
        """Return the certification of a search that has converged, beginning it if it is new."""
        bracket = self._converged_bracket(at) if self._study.search.certify else None
        if bracket is None:
            return None
        if at not in self._certifications:
            self._certifications[at] = PointSearch(
                certification_of(self._study, bracket),
                at,
                lambda value: certifying_scene(self._study.scene_at(at, value)),
                partial(side_of, self._study),
                self._known,
            )
            self._certifications[at].take_all_known()
        return self._certifications[at]

    def _converged(self) -> dict[float, tuple[float, float]]:
        brackets = {at: self._converged_bracket(at) for at in self._searches}
        return {at: bracket for at, bracket in brackets.items() if bracket is not None}

    def _converged_bracket(self, at: float) -> tuple[float, float] | None:
        search = self._searches[at].search
        low, high = search.bracket if search.status is SearchStatus.CONVERGED else (None, None)
        return None if low is None or high is None else (low, high)

    def _halvings(self, at: float) -> float:
        limits = self._study.search.limits
        bracket = self._searches[at].search.bracket
        low, high = (end or limit for end, limit in zip(bracket, limits, strict=True))
        return max(1.0, math.log2(math.log(high / low) / math.log1p(self._study.search.tolerance)))

    def _point(self, at: float) -> BoundaryPoint:
        search, certification = self._searches[at], self._certification(at)
        bracket, status, runs = search.search.bracket, str(search.search.status), search.runs
        outcomes, certified_by = search.outcomes(bracket), None
        if certification is not None:
            result, ends = certification.search.result, certification.search.bracket
            status, runs = str(result), runs + certification.runs
            if ends is not None:
                bracket, outcomes = ends, certification.outcomes(ends)
                if result is CertificationResult.CONVERGED:
                    certified_by = certifying_scene(self._study.scene_at(at, ends[0])).numerics
        return BoundaryPoint(
            parameters={self._study.sweep.parameter: at},
            bracket=bracket,
            outcomes=outcomes,
            status=status,
            certified=certified_by is not None,
            certified_by=certified_by,
            runs=runs,
        )
