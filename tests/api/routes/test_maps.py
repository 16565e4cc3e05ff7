"""Maps over HTTP."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from ensemble.config.documents import load
from ensemble.config.outcome_map import OutcomeMap
from ensemble.questions.map_question import MapQuestion
from ensemble.search.map_record import MapRecord, MapRunRecord
from ensemble.store import Store
from solver.scene import Units
from tests.api.servers import client_of


def example_map(key: str | None = None) -> MapRecord:
    """A map of two by two cells."""
    question = load(OutcomeMap, "shear-hamaker-map", {"axes.resolution": 0.5})
    return MapRecord(
        key=key or question.key,
        name=question.name,
        map=question.model_dump(mode="json"),
        labels=["bound", "separated"],
        cells=[[1, 0], [1, 1]],
        runs=[MapRunRecord(cell=(0, 1), run=32 * "a")],
        updated=datetime(2026, 1, 1, tzinfo=UTC),
    )


@pytest.fixture
def store(tmp_path: Path) -> Path:
    with Store.open(tmp_path / "store") as opened:
        opened.save_map(example_map())
        opened.save_map(example_map(16 * "0"))
    return tmp_path / "store"


def test_maps_are_listed_and_given_with_the_values_along_their_axes(store: Path) -> None:
    with client_of(store) as client:
        page = client.get("/maps", params={"limit": 1}).json()
        assert [(each["key"], each["runs"]) for each in page["items"]] == [(16 * "0", 1)]
        assert [each["key"] for each in client.get(page["next"]).json()["items"]] == [example_map().key]
        answer = client.get(f"/maps/{example_map().key}")
        document = answer.json()
        assert document["values"] == [[0.55, 1.25], [0.45, 1.15]]
        assert document["edges"] == [[0.2, 0.9, 1.6], [0.1, 0.8, 1.5]]
        assert (document["cells"], document["runs"][0]["cell"]) == ([[1, 0], [1, 1]], [0, 1])
        tag = {"If-None-Match": answer.headers["etag"]}
        assert client.get(f"/maps/{example_map().key}", headers=tag).status_code == 304


def test_what_is_no_map_is_not_found(store: Path) -> None:
    with client_of(store) as client:
        assert client.get(f"/maps/{16 * 'f'}").status_code == 404
        assert client.get(f"/maps/{16 * 'f'}/file?format=png").status_code == 404
        assert client.get(f"/maps/{example_map().key}/file?format=csv").status_code == 422
        assert client.get(f"/maps/{16 * 'f'}/units").status_code == 404
        assert client.get("/maps/nothing").status_code == 422
        filtered = client.get("/maps", params={"where": "name=x"})
        assert (filtered.status_code, filtered.json()["detail"]) == (
            422,
            "where: 'name=x' — maps are listed whole, without conditions",
        )


def test_a_value_times_the_size_of_its_unit_is_what_the_terminal_shows(tmp_path: Path) -> None:
    units = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
    record = example_map().in_units(units)
    with Store.open(tmp_path / "store") as opened:
        opened.save_map(record)
        stored = MapQuestion.stored(opened, record.name)
    assert stored is not None
    with client_of(tmp_path / "store") as client:
        sizes = client.get(f"/maps/{record.key}/units").json()["sizes"]
    document = stored.json_document()
    assert document["in_units"].keys() == document["values"].keys()
    for parameter, shown in document["in_units"].items():
        values = [value * sizes[parameter]["value"] for value in document["values"][parameter]]
        assert shown["value"] == pytest.approx(values, rel=1e-12)
        assert shown["unit"] == sizes[parameter]["unit"]
    assert document["in_units"]["flow.rate"]["unit"] == "1/s"


def test_a_map_is_given_as_a_figure(store: Path) -> None:
    """Takes 3 s: the figure is made by a process of its own."""
    with client_of(store) as client:
        answer = client.get(f"/maps/{example_map().key}/file", params={"format": "png"}, timeout=300)
    assert answer.headers["content-type"] == "image/png"
    assert answer.content.startswith(b"\x89PNG")
