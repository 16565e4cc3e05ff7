"""Boundaries over HTTP, and critical values read from them."""

from __future__ import annotations

import csv

import pytest

from ensemble.search.boundary import Boundary
from ensemble.store import Store
from tests.api.servers import client_of
from tests.api.stores import SWEEP, critical, example_boundary
from tests.ensemble.runs import shear_run, shear_scene


@pytest.fixture(scope="module")
def address(reading) -> str:
    (boundary,) = reading.get("/boundaries").json()["items"]
    return f"/boundaries/{boundary['study_key']}"


def test_a_boundary_is_the_stored_one_with_a_line(reading, address, filled_store):
    with Store.existing(filled_store) as store:
        (stored,) = store.boundaries()
    document = reading.get(address).json()
    line = document.pop("fit")
    assert Boundary.model_validate(document) == stored
    # The least-squares line through four points of a parabola.
    for rate in SWEEP:
        assert line["intercept"] + line["slope"] * rate == pytest.approx(critical(rate), rel=0.05)
    assert line["slope"] == pytest.approx(0.5 + 0.05 * 1.71, rel=0.05)


def test_boundaries_are_filtered_and_paged(tmp_path):
    boundary = example_boundary()
    keys = [f"{number:016x}" for number in range(5)]
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        for key in reversed(keys):
            store.save_boundary(boundary.model_copy(update={"study_key": key, "name": f"study {key[-1]}"}))
        page = client.get("/boundaries", params={"limit": 2}).json()
        listed = [found["study_key"] for found in page["items"]]
        while page["next"]:
            page = client.get(page["next"]).json()
            listed += [found["study_key"] for found in page["items"]]
        assert listed == keys
        (third,) = client.get("/boundaries", params={"where": "name=study 3"}).json()["items"]
        assert third["study_key"] == keys[3]


def test_the_runs_of_a_boundary_are_listed_once_each_in_pages(tmp_path):
    runs = [shear_run(shear_scene(rate=rate)) for rate in (0.5, 0.6, 0.7, 0.8)]
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        *decisive, _ = [store.save(run) for run in runs]
        gone = 32 * "0"  # set aside since
        boundary = example_boundary()
        first, second, *others = boundary.points
        shared = [
            first.model_copy(update={"runs": [gone, *decisive]}),
            second.model_copy(update={"runs": decisive}),
        ]
        store.save_boundary(boundary.model_copy(update={"points": [*shared, *others]}))
        address = f"/boundaries/{boundary.study_key}/runs"
        listed, pages, query = [], 0, "?limit=1"
        while query:
            page = client.get(address + query).json()
            listed += page["items"]
            pages += 1
            query = (page["next"] or "").removeprefix("runs")
        assert pages == 3
        assert [run["key"] for run in listed] == sorted(decisive)
        assert listed[0] == client.get(f"/runs/{listed[0]['key']}").json()


def test_a_boundary_that_has_changed_is_sent_again(tmp_path):
    boundary = example_boundary()
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        store.save_boundary(boundary)
        first = client.get(f"/boundaries/{boundary.study_key}")
        tag = {"If-None-Match": first.headers["etag"]}
        assert client.get(f"/boundaries/{boundary.study_key}", headers=tag).status_code == 304
        grown = example_boundary().model_copy(update={"points": boundary.points[:2]})
        store.save_boundary(grown)
        second = client.get(f"/boundaries/{boundary.study_key}", headers=tag)
        assert len(second.json()["points"]) == 2
        assert second.json()["fit"] is None, "two points lie on a line whatever the physics"


@pytest.mark.parametrize("rate", SWEEP)
def test_at_a_point_the_value_is_that_of_the_point(reading, address, rate):
    answer = reading.get(f"{address}/at", params={"flow.rate": rate}).json()
    low, high = critical(rate) / 1.005, critical(rate) * 1.005
    assert answer["critical_value"] == pytest.approx(critical(rate), rel=1e-12)
    assert answer["uncertainty"] == pytest.approx([low, high], rel=1e-12)
    assert answer["points"] == [{"flow.rate": rate}]


@pytest.mark.parametrize("rate", [0.3, 0.4, 0.6, 0.75, 0.99, 1.2, 1.45])
def test_between_points_the_uncertainty_contains_the_exact_value(reading, address, rate):
    answer = reading.get(f"{address}/at", params={"flow.rate": rate}).json()
    low, high = answer["uncertainty"]
    assert low < critical(rate) < high
    assert low < answer["critical_value"] < high
    assert answer["method"] == "interpolated"
    assert answer["parameters"] == {"flow.rate": rate}
    (left,), (right,) = (point.values() for point in answer["points"])
    assert left < rate < right
    # The interval is not wider than the brackets of one percent and the deviation of the parabola.
    bend = 0.05 * (rate - left) * (right - rate)
    width = (1.005 - 1 / 1.005) * answer["critical_value"]
    assert high - low == pytest.approx(width + 2 * bend, rel=1e-9)


def test_the_nearest_point_says_where_it_is(reading, address):
    answer = reading.get(f"{address}/at", params={"flow.rate": 7.0, "method": "nearest"}).json()
    assert answer["parameters"] == {"flow.rate": 1.5}
    assert answer["method"] == "nearest"
    assert answer["critical_value"] == pytest.approx(critical(1.5), rel=1e-12)


@pytest.mark.parametrize(
    ("query", "named"),
    [
        ({"flow.rate": 7.0}, "within [0.25, 1.5]"),
        ({"flow.rate": 0.1}, "within [0.25, 1.5]"),
        ({"flow.rate": "nan"}, "flow.rate"),
        ({"flow.rate": "1e999"}, "flow.rate"),
        ({"flow.rate": "a lot"}, "flow.rate"),
        ({}, "flow.rate"),
        ({"adhesion.distance": 0.4}, "flow.rate"),
        ({"flow.rate": 0.5, "adhesion.distance": 0.4}, "flow.rate"),
        ({"flow.rate": 0.5, "method": "guess"}, "method"),
        ({"flow.rate": [0.5, 0.6]}, "flow.rate: given several times"),
    ],
)
def test_values_that_cannot_be_read_are_refused(reading, address, query, named):
    response = reading.get(f"{address}/at", params=query)
    assert response.status_code == 422
    assert named in response.json()["detail"]


def test_an_unknown_boundary_is_not_found(reading):
    for part in ("", "/at?flow.rate=1", "/runs"):
        assert reading.get(f"/boundaries/0000000000000000{part}").status_code == 404


def test_a_boundary_without_a_converged_point_has_no_value(tmp_path):
    boundary = example_boundary()
    with Store.open(tmp_path / "store") as store, client_of(store.path) as client:
        store.save_boundary(boundary.model_copy(update={"points": boundary.points[-1:]}))
        response = client.get(f"/boundaries/{boundary.study_key}/at", params={"flow.rate": 1})
        assert response.status_code == 422
        assert "converged" in response.json()["detail"]


def test_a_boundary_is_given_as_a_table(reading, address):
    answer = reading.get(f"{address}/file", params={"format": "csv"})
    assert answer.headers["content-type"] == "text/csv; charset=utf-8"
    assert 'filename="boundary-' in answer.headers["content-disposition"]
    *rows, searching = csv.DictReader(answer.text.splitlines())
    assert [float(row["flow.rate"]) for row in rows] == list(SWEEP)
    assert [float(row["bracket low"]) for row in rows] == [critical(rate) / 1.005 for rate in SWEEP]
    assert {(row["outcome below"], row["outcome above"]) for row in rows} == {("separated", "bound")}
    assert (searching["status"], searching["bracket high"]) == ("searching", "")
    assert reading.get(f"/boundaries/{'0' * 16}/file?format=csv").status_code == 404
    assert reading.get(f"{address}/file?format=exe").status_code == 422
