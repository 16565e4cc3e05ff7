"""Keys of runs: equal for equal scenes, different for any difference."""

from __future__ import annotations

import copy
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from ensemble.config import run_key as keys
from ensemble.config.run_key import run_key
from solver.scene import Scene
from tests.ensemble.runs import quiescent_scene, shear_scene

DOCUMENT = shear_scene().model_dump(mode="json")


def leaves(node: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from leaves(value, (*path, key))
    else:
        yield path, node


def smallest_change(path: tuple[str | int, ...], value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + (2 if path[-1] == "points" else 1)
    if isinstance(value, float):
        return math.nextafter(value, -1.0)
    return {"shear": "extension", "auto": "bdf"}[value]


def test_key_is_32_hexadecimal_digits() -> None:
    assert re.fullmatch("[0-9a-f]{32}", run_key(shear_scene()))


def test_equal_scenes_have_equal_keys() -> None:
    reversed_fields = dict(reversed(DOCUMENT.items()))
    whole_number = {**DOCUMENT, "horizon": 100}
    negative_zero = copy.deepcopy(DOCUMENT)
    negative_zero["vesicles"][0]["center"][1] = -0.0
    for document in (reversed_fields, whole_number, negative_zero):
        scene = Scene.model_validate(document)
        assert scene == shear_scene()
        assert run_key(scene) == run_key(shear_scene())


@pytest.mark.parametrize(
    ("path", "value"),
    # Two belong to other integrators than the document's, two are not set, and there is one kind of adhesion.
    # The units are no part of the key.
    [
        (path, value)
        for path, value in leaves(DOCUMENT)
        if path[-1] not in ("order", "step_control", "cutoff", "wall_limit")
        and path not in (("adhesion", "kind"), ("units",))
    ],
    ids=lambda part: ".".join(map(str, part)) if isinstance(part, tuple) else None,
)
def test_smallest_change_of_any_field_changes_the_key(path: tuple[str | int, ...], value: Any) -> None:
    changed = copy.deepcopy(DOCUMENT)
    node: Any = changed
    for part in path[:-1]:
        node = node[part]
    node[path[-1]] = smallest_change(path, value)
    assert run_key(Scene.model_validate(changed)) != run_key(shear_scene())


def test_options_of_an_integrator_change_the_key() -> None:
    numerics: list[dict[str, Any]] = [
        {},
        {"integrator": "sdc"},
        {"integrator": "sdc", "order": 2},
        {"integrator": "sdc", "order": 2, "step_control": "area-length"},
    ]
    assert len({run_key(Scene.model_validate({**DOCUMENT, "numerics": each})) for each in numerics}) == 4


def test_limits_that_are_not_set_change_the_key_when_they_are() -> None:
    adhesion, numerics = DOCUMENT["adhesion"], DOCUMENT["numerics"]
    documents = [
        DOCUMENT,
        {**DOCUMENT, "adhesion": {**adhesion, "cutoff": 2.0}},
        {**DOCUMENT, "numerics": {**numerics, "wall_limit": 60.0}},
    ]
    assert len({run_key(Scene.model_validate(document)) for document in documents}) == 3


def test_leaving_a_term_out_changes_the_key() -> None:
    variants = [DOCUMENT, {**DOCUMENT, "adhesion": None}, {**DOCUMENT, "flow": None}]
    assert len({run_key(Scene.model_validate(document)) for document in variants}) == 3


def test_the_revision_of_the_results_is_part_of_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    before = run_key(quiescent_scene())
    monkeypatch.setattr(keys, "RESULTS_REVISION", keys.RESULTS_REVISION + 1)
    assert run_key(quiescent_scene()) != before


def test_key_is_the_same_in_another_process() -> None:
    script = (
        "from ensemble.config.run_key import run_key\n"
        "from tests.ensemble.runs import shear_scene\n"
        "print(run_key(shear_scene()))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "7"}
    other = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    assert other.stdout.strip() == run_key(shear_scene())
