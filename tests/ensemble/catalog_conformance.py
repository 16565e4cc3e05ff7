"""What a catalog does, whatever database it is in: a class of tests that those of each database inherit."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from ensemble.config.run_key import run_key
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import NotStored, Store, StoreInputError
from ensemble.store.listing import Listing, ParameterRange
from ensemble.store.run_record import RunSummary
from solver.analysis.run import Outcome
from solver.scene import Numerics
from tests.ensemble.runs import failed_run, quiescent_scene, shear_run, shear_scene

# The third rate and the period have all 17 digits; they have to compare exactly.
RATES = [0.25, 0.5, 0.1 + 0.2, 1.0]
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)


def boundary(study_key: str, low: float, high: float | None, updated: datetime) -> Boundary:
    point = BoundaryPoint(
        parameters={"flow.rate": 0.5},
        bracket=(low, high),
        outcomes=("separated", None if high is None else "bound"),
        status="converged",
        certified=False,
        runs=["a", "b"],
    )
    study = {"name": "critical", "scene": {"adhesion": {"distance": low}}}
    return Boundary(study_key=study_key, study=study, name="critical", points=[point], updated=updated)


@contextmanager
def made_with(database: str | None, path: Path) -> Iterator[Store]:
    """Make a store while the environment names a database."""
    with pytest.MonkeyPatch.context() as patch:
        if database is None:
            patch.delenv("ENSEMBLE_DATABASE", raising=False)
        else:
            patch.setenv("ENSEMBLE_DATABASE", database)
        store = Store.open(path)
    with store:
        yield store


class CatalogConformance:
    """Subclasses have a fixture `database`: its URL, or None for a file."""

    @pytest.fixture
    def store(self, database: str | None, tmp_path: Path) -> Iterator[Store]:
        with made_with(database, tmp_path / "store") as opened:
            yield opened

    @pytest.fixture(scope="class")
    @classmethod
    def filled(cls, database: str | None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
        outcomes = [Outcome.BOUND, Outcome.SEPARATED, Outcome.END_TO_END, Outcome.BOUND]
        with made_with(database, tmp_path_factory.mktemp("filters") / "store") as store:
            for rate, outcome in zip(RATES, outcomes, strict=True):
                run = shear_run(shear_scene(rate, hamaker=4 * rate), outcome)
                store.save(replace(run, period=10 / rate))
            # A period that is not a number is no number to compare with.
            store.save(replace(failed_run(), period=float("nan")))
            yield store

    @pytest.mark.parametrize(
        ("where", "rates"),
        [
            ([], {*RATES, None}),
            (["flow.rate>=0.5"], {0.5, 1.0}),
            (["flow.rate > 0.5"], {1.0}),
            (["flow.rate<0.5"], {0.25, RATES[2]}),
            (["flow.rate<=0.25"], {0.25}),
            (["flow.rate=0.30000000000000004"], {RATES[2]}),
            (["flow.rate=0.3"], set()),
            (["flow.rate!=1"], {0.25, 0.5, RATES[2]}),
            (["adhesion.hamaker<2", "flow.rate>0.25"], {RATES[2]}),
            (["outcome=bound"], {0.25, 1.0}),
            (["outcome=end-to-end"], {RATES[2]}),
            (["outcome!=bound"], {0.5, RATES[2], None}),
            (["period>=10"], set(RATES)),
            (["period=33.33333333333333"], {RATES[2]}),
            (["flow=null"], {None}),
            (["flow!=null"], set(RATES)),
            (["failure!=null"], {None}),
            (["flow.kind=shear"], set(RATES)),
            (["flow.kind=trap"], set()),
            (["start.relaxed=false", "numerics.points=32"], set(RATES)),
            (["start.relaxed=true"], set()),
            (["vesicles.0.center.0<-1"], set(RATES)),
            (["vesicles.0.reduced_area=1"], {None}),
            (["vesicles.reduced_area=0.9"], set(RATES)),
            (["vesicles.reduced_area=1"], {None}),
            (["vesicles.center.0<0"], set()),
            (["vesicles.center.0<=1.5", "vesicles.viscosity_contrast=1"], {*RATES, None}),
            (["vesicles.angle!=null"], {*RATES, None}),
            (["viscosity.total>-1"], set(RATES)),
            (["work.steps>=400", "flow=null"], {None}),
            (["created>2000-01-01"], {*RATES, None}),
            (["created<2000-01-01T00:00:00Z"], set()),
            ([f"key={run_key(quiescent_scene())}"], {None}),
        ],
    )
    def test_filter(self, filled: Store, where: list[str], rates: set[float | None]) -> None:
        found = filled.summaries(where)
        assert {None if summary.scene.flow is None else summary.scene.flow.rate for summary in found} == rates
        assert len(found) == len(rates)

    @pytest.mark.parametrize(
        ("where", "message"),
        [
            ("flow.rate", "'flow.rate' is not of the form"),
            ("flow.rate==1", "'flow.rate==1' is not of the form"),
            ("flow.rate=", "'flow.rate=' is not of the form"),
            ("=1", "'=1' is not of the form"),
            ("flow.rat=1", "'flow.rat'"),
            ("rate=1", "unknown field 'rate'"),
            ("scene.flow.rate=1", "unknown field 'scene.flow.rate'"),
            ("horizon.seconds=1", "'horizon.seconds'"),
            ("vesicles.reduced=1", "unknown field 'vesicles.reduced'"),
            ("vesicles.0.center.2=1", "'vesicles.0.center.2'"),
            ("flow.rate=fast", "'fast' is no value of flow.rate"),
            ("numerics.points>1.5", "'1.5' is no value of numerics.points"),
            ("outcome=bond", "'bond' is no value of outcome.*'bound'"),
            ("flow.kind=sheer", "'sheer' is no value of flow.kind.*'extension'.*'shear'.*'trap'"),
            ("numerics.integrator=bdff", "'bdff' is no value of numerics.integrator.*'bdf'"),
            ("start.relaxed=maybe", "'maybe' is no value of start.relaxed"),
            ("created>today", "'today' is no value of created"),
            ("outcome<bound", "outcome is not a number"),
            ("flow=shear", "flow is a group of fields"),
            ("period<null", "'null' is no value of period"),
            ("failure=\0", "not of the form"),
        ],
    )
    def test_wrong_filter_is_named(self, filled: Store, where: str, message: str) -> None:
        with pytest.raises(ValueError, match=f"^where: .*{message}"):
            filled.summaries([where])

    @pytest.mark.parametrize(
        ("sort", "rates"),
        [
            ("flow.rate", [*sorted(RATES), None]),
            ("-flow.rate", [*sorted(RATES, reverse=True), None]),
            ("-outcome", [0.5, None, RATES[2], 1.0, 0.25]),  # equal ones come newest first
            ("period", [1.0, 0.5, RATES[2], 0.25, None]),
            ("vesicles.reduced_area", [*RATES[::-1], None]),
            ("created", [*RATES, None]),
            (None, [None, *RATES[::-1]]),
        ],
    )
    def test_order(self, filled: Store, sort: str | None, rates: list[float | None]) -> None:
        def listed(limit: int | None) -> list[float | None]:
            found = map(
                RunSummary.model_validate_json,
                (record.json for record in filled.run_records(Listing(sort=sort, limit=limit))),
            )
            return [None if summary.scene.flow is None else summary.scene.flow.rate for summary in found]

        assert listed(None) == rates
        assert listed(2) == rates[:2]

    def test_parameters_within_ranges(self, filled: Store) -> None:
        rate, hamaker = ParameterRange("flow.rate", 0.25, 0.5), ParameterRange("adhesion.hamaker", 1.1, 4.0)
        assert set(filled.parameters_within(rate)) == {(0.25,), (RATES[2],), (0.5,)}
        assert set(filled.parameters_within(rate, hamaker)) == {(RATES[2], 4 * RATES[2]), (0.5, 2.0)}
        assert list(filled.parameters_within(ParameterRange("vesicles.reduced_area", 0.9, 0.9))) == [(0.9,)]

    @pytest.mark.parametrize("sort", ["flow", "flow.rat", "vesicles", "vesicles.center", "", "--flow.rate"])
    def test_what_cannot_be_sorted_by_is_named(self, filled: Store, sort: str) -> None:
        with pytest.raises(StoreInputError, match=r"^sort: "):
            filled.run_records(Listing(sort=sort))

    def test_boundary_is_replaced_at_once_and_seen_by_others(self, store: Store) -> None:
        with Store.existing(store.path) as observer:
            assert observer.boundaries() == []
            store.save_boundary(boundary("a", 0.1, None, NOON))
            assert observer.boundaries() == [boundary("a", 0.1, None, NOON)]
            store.save_boundary(boundary("b", 0.2, None, NOON + timedelta(seconds=1)))
            store.save_boundary(boundary("a", 0.1, 0.3, NOON + timedelta(seconds=2)))
            assert [found.study_key for found in observer.boundaries()] == ["b", "a"]
            assert observer.boundaries()[1] == boundary("a", 0.1, 0.3, NOON + timedelta(seconds=2))
        assert store.check() == []

    def test_boundary_filters(self, store: Store) -> None:
        store.save_boundary(boundary("a", 0.1, None, NOON))
        store.save_boundary(boundary("b", 0.2, 0.4, NOON + timedelta(hours=1)))

        def found(*where: str) -> list[str]:
            return [boundary.study_key for boundary in store.boundaries(where)]

        assert found("name=critical") == ["a", "b"]
        assert found("name=other") == []
        assert found("study.scene.adhesion.distance>0.15") == ["b"]
        assert found("study.name=critical", "study_key=a") == ["a"]
        assert found("points.0.critical_value=null") == ["a"]
        assert found("points.0.parameters.flow=1") == []
        assert found("updated>2026-01-01T12:30:00") == ["b"]
        with pytest.raises(StoreInputError, match="unknown field 'title'"):
            found("title=x")

    def test_a_number_is_compared_with_numbers_only(self, store: Store) -> None:
        store.save_boundary(boundary("a", 0.1, None, NOON))
        assert store.boundaries(["study.name>0"]) == []
        assert store.boundaries(["study.name=true"]) == []
        automatic = shear_scene().model_copy(update={"numerics": Numerics(points="auto")})
        store.save(replace(shear_run(), scene=automatic))
        assert store.summaries(["numerics.points<64"]) == []
        assert len(store.summaries(["numerics.points=auto"])) == 1

    def test_pages_hold_every_run_once_the_newest_first(self, filled: Store) -> None:
        keys = [summary.key for summary in filled.summaries()][::-1]
        found, after = [], None
        while page := filled.runs_page(after=after, limit=2):
            found += [record.key for record in page]
            after = found[-1]
        assert found == keys
        assert [record.key for record in filled.runs_page(["flow=null"])] == [run_key(quiescent_scene())]
        with pytest.raises(StoreInputError, match="after"):
            filled.runs_page(after="nothing")

    def test_boundaries_by_their_name_or_the_beginning_of_their_key(self, store: Store) -> None:
        others = {"abc": "50% of _all_", "abd": "critical", "ac": "critical"}
        for hour, (study_key, name) in enumerate(others.items()):
            made = boundary(study_key, 0.1, None, NOON - timedelta(hours=hour))
            store.save_boundary(made.model_copy(update={"name": name}))

        def found(name: str) -> list[str]:
            return [each.study_key for each in store.boundaries_named(name)]

        assert found("critical") == ["ac", "abd"], "the latest change last"
        assert found("50% of _all_") == ["abc"]
        assert found("ab") == ["abd", "abc"]
        assert found("abc") == ["abc"]
        assert found("%") == found("_b") == found("crit") == []

    def test_changed_studies_are_found_by_the_name_without_the_changes(self, store: Store) -> None:
        for study_key, name in {
            "abc": "a_b, x=1",
            "abd": "a_b, y=2",
            "abe": "a_b-c",
            "abf": "axb, z=3",
        }.items():
            made = boundary(study_key, 0.1, None, NOON)
            store.save_boundary(made.model_copy(update={"name": name}))
        assert [each.study_key for each in store.boundaries_named("a_b")] == ["abc", "abd"]

    def test_pages_of_boundaries_are_in_the_order_of_their_keys(self, store: Store) -> None:
        for study_key in "cab":
            store.save_boundary(boundary(study_key, 0.1, None, NOON))
        assert [record.key for record in store.boundaries_page(limit=2)] == ["a", "b"]
        assert [record.key for record in store.boundaries_page(after="b")] == ["c"]

    def test_a_record_is_the_json_of_its_model(self, filled: Store) -> None:
        for summary in filled.summaries():
            assert json.loads(filled.run_record(summary.key).json) == summary.document()
            expected = (summary.outcome, summary.sensitive, summary.configuration)
            assert filled.answer(summary.key) == expected

    def test_what_is_not_there_is_said_so(self, store: Store) -> None:
        for ask in (store.summary, store.run_record, store.boundary, store.boundary_record):
            with pytest.raises(NotStored):
                ask("nothing")
        assert not store.contains("nothing")
        assert store.answer("nothing") is None

    def test_a_store_is_opened_again_and_swept_without_losing_a_run(self, store: Store) -> None:
        key = store.save(shear_run())
        with Store.open(store.path) as again, Store.existing(store.path) as existing:
            assert again.load(key).scene == shear_scene()
            assert [summary.key for summary in existing.summaries()] == [key]
            assert again.save(shear_run(seed=1)) == key, "the first stays"
            assert again.check() == []
