"""Overrides reach the fields they name, and refusals say which field and why."""

from __future__ import annotations

import copy
import re
from typing import Any

import pytest
from pydantic import ValidationError

from ensemble.config.documents import preset_document
from ensemble.config.dotted_paths import locations
from ensemble.config.overrides import LONGEST_NAME, override, parse_override
from ensemble.config.study import Study
from ensemble.config.validation import explain, validated
from solver.scene import Scene

DOUBLET: dict[str, Any] = {
    "horizon": 10.0,
    "vesicles": [{"center": [-1.5, 0.0]}, {"center": [1.5, 0.0]}],
    "flow": {"kind": "shear", "rate": 0.5},
}


def refusal(changes: dict[str, Any]) -> str:
    """Return the message about a doublet with these changes."""
    document = override(DOUBLET, changes)
    with pytest.raises(ValidationError) as refused:
        Scene.model_validate(document)
    return explain(refused.value, document)


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("flow.rate=0.5", "flow.rate", 0.5),
        ("numerics.points = 128", "numerics.points", 128),
        ("start.relaxed=true", "start.relaxed", True),
        ("vesicles.0.center=[1.5, -0.5]", "vesicles.0.center", [1.5, -0.5]),
        ('flow.kind="trap"', "flow.kind", "trap"),
        ("flow.kind=trap", "flow.kind", "trap"),
        ("search.low=['bound', 'end-to-end']", "search.low", ["bound", "end-to-end"]),
        ("flow={kind = 'shear', rate = 1.0}", "flow", {"kind": "shear", "rate": 1.0}),
        ("name='a=b'", "name", "a=b"),
    ],
)
def test_parse(text: str, path: str, value: object) -> None:
    parsed = parse_override(text)
    assert parsed == (path, value)
    assert type(parsed[1]) is type(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("flow.rate", "expected key.path=value"),
        ("=0.5", "expected key.path=value"),
        ("flow.rate=", "flow.rate: '' is not a TOML value"),
        ("flow.rate=.5", "flow.rate: '.5' is not a TOML value"),
        ("flow.rate=[1,", "flow.rate: '\\[1,' is not a TOML value"),
        ("flow.rate=1\nhorizon=2", "flow.rate: .* more than one TOML value"),
    ],
)
def test_parse_refuses(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_override(text)


def test_a_name_sets_every_element_of_an_array_and_an_index_one() -> None:
    changed = override(DOUBLET, {"vesicles.reduced_area": 0.8, "vesicles.1.angle": 1.0})
    assert changed["vesicles"] == [
        {"center": [-1.5, 0.0], "reduced_area": 0.8},
        {"center": [1.5, 0.0], "reduced_area": 0.8, "angle": 1.0},
    ]


def test_the_document_is_left_as_it_was() -> None:
    before = copy.deepcopy(DOUBLET)
    override(DOUBLET, {"vesicles.center": [0.0, 0.0], "flow.rate": 1.0, "start.tilt": 0.1})
    assert before == DOUBLET


def test_elements_do_not_share_a_value_that_is_set_in_all() -> None:
    changed = override(DOUBLET, {"vesicles.center": [0.0, 0.0], "vesicles.0.center.1": 2.0})
    assert [vesicle["center"] for vesicle in changed["vesicles"]] == [[0.0, 2.0], [0.0, 0.0]]


def test_missing_tables_are_made_and_what_they_lack_is_named() -> None:
    assert override(DOUBLET, {"a.b.c": 1})["a"] == {"b": {"c": 1}}
    assert override({"adhesion": None}, {"adhesion.hamaker": 1.0}) == {"adhesion": {"hamaker": 1.0}}
    assert refusal({"adhesion.hamaker": 1.0}) == "adhesion.distance: field required"


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("vesicles.2.angle", "vesicles.2: no such element, there are 2"),
        ("horizon.end", "horizon: 10.0 — has no field 'end'"),
        ("flow.kind.name", "flow.kind: 'shear' — has no field 'name'"),
        ("flow..rate", "expected names joined by single dots"),
        ("", "expected names joined by single dots"),
    ],
)
def test_paths_that_lead_nowhere_are_refused(path: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        override(DOUBLET, {path: 1.0})


def test_locations_of_a_path() -> None:
    assert locations(DOUBLET, "vesicles.angle") == (("vesicles", 0, "angle"), ("vesicles", 1, "angle"))
    assert locations(DOUBLET, "flow.rate") == (("flow", "rate"),)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"vesicles.0.reduced_area": 1.2},
            "vesicles.0.reduced_area: 1.2 — input should be less than or equal to 1",
        ),
        ({"horizon": -3}, "horizon: -3 — input should be greater than 0"),
        ({"flow": {"rate": 1.0}}, "flow: needs a kind"),
        (
            {"numerics.points": 8},
            "numerics.points: 8 — input should be greater than or equal to 16, or input should be 'auto'",
        ),
        ({"flow.rate": -1.0}, "flow.rate: -1.0 — input should be greater than or equal to 0"),
        ({"flow.speed": 3}, "flow.speed: 3 — extra inputs are not permitted"),
        ({"flow": {"kind": "trap"}}, "flow.rate: field required"),
        ({"flow": {"kind": "trap", "rate": "fast"}}, "flow.rate: 'fast' — input should be a valid number"),
        ({"shear.rate": 1.0}, "shear: extra inputs are not permitted"),
        (
            {"adhesion": {"hamaker": 1.0, "distance": 0.4, "exponents": [2, 4]}},
            "adhesion: exponents must be integers m > n >= 2, got [2, 4]",
        ),
        (
            {"vesicles.length": 0.0},
            "vesicles.0.length: 0.0 — input should be greater than 0; "
            "vesicles.1.length: 0.0 — input should be greater than 0",
        ),
    ],
)
def test_a_refusal_names_field_value_and_allowed_range(changes: dict[str, Any], message: str) -> None:
    assert refusal(changes).startswith(message)
    assert refusal(changes).count(";") == message.count(";")


@pytest.mark.parametrize(
    ("model", "document", "message"),
    [
        (Scene, override(DOUBLET, {"horizon": True}), "horizon: true — input should be a number"),
        (
            Scene,
            override(DOUBLET, {"vesicles.0.center": [False, 0.0]}),
            "vesicles.0.center.0: false — input should be a number",
        ),
        (
            Study,
            override(preset_document("critical-hamaker"), {"sweep.values": [0.5, True]}),
            "sweep.values.1: true — input should be a number",
        ),
    ],
)
def test_true_is_no_number(model: type[Scene] | type[Study], document: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        validated(model, document)


def test_an_unknown_kind_of_flow_is_told_the_known_ones() -> None:
    message = refusal({"flow.kind": "vortex"})
    assert message.startswith("flow: ")
    assert all(kind in message for kind in ("vortex", "shear", "extension", "trap"))


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "mine"),
        ({"scene.horizon": 20.0}, "mine, scene.horizon=20.0"),
        ({"scene.horizon": 20.0, "sweep.values": [0.5]}, "mine, scene.horizon=20.0, sweep.values=[0.5]"),
        ({"sweep.values": [0.5], "scene.horizon": 20.0}, "mine, scene.horizon=20.0, sweep.values=[0.5]"),
        ({"scene.horizon": 10.0}, "mine"),  # as it was
        ({"scene.units.radius": "10 um"}, "mine"),
        ({"scene.flow.kind": "trap"}, 'mine, scene.flow.kind="trap"'),
        ({"name": "yours", "scene.horizon": 20.0}, "yours"),
        ({"scene.note": "x" * 200}, 'mine, scene.note="' + "x" * 81 + "…"),
    ],
)
def test_a_changed_document_with_a_name_is_called_after_its_changes(
    changes: dict[str, Any], name: str
) -> None:
    changed = override({"name": "mine", "scene": {"horizon": 10.0}}, changes)
    assert changed["name"] == name
    assert len(name) <= LONGEST_NAME


SUSPENSION: dict[str, Any] = {
    "horizon": 10.0,
    "arrangement": {"kind": "random", "count": 5, "area_fraction": 0.2},
}


def test_an_arrangement_can_be_changed_and_so_can_its_vesicles() -> None:
    changed = override(SUSPENSION, {"vesicles.bending_modulus": 2.0, "arrangement.count": 6})
    scene = Scene.model_validate(changed)
    assert [vesicle.bending_modulus for vesicle in scene.vesicles] == [2.0] * 6
    kept = override(SUSPENSION, {"arrangement.seed": 3, "horizon": 5.0})
    assert kept["arrangement"] == {**SUSPENSION["arrangement"], "seed": 3}
    expected = [vesicle.center for vesicle in Scene.model_validate(SUSPENSION).vesicles]
    study = override({"scene": SUSPENSION}, {"scene.vesicles.0.angle": 1.0})
    assert [tuple(vesicle["center"]) for vesicle in study["scene"]["vesicles"]] == expected
    assert study["scene"]["vesicles"][0]["angle"] == 1.0


def test_vesicles_of_an_arrangement_that_cannot_be_are_refused_by_its_name() -> None:
    with pytest.raises(ValueError, match=r"arrangement: area_fraction: 2"):
        override(SUSPENSION, {"vesicles.angle": 1.0, "arrangement.area_fraction": 2})
