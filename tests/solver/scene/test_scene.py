"""Scenes refuse what cannot be simulated, name the field, and survive JSON and TOML."""

from __future__ import annotations

import copy
import math
import tomllib
from typing import Any

import pytest
from pydantic import ValidationError

from solver.scene import (
    Criteria,
    Extension,
    Numerics,
    Output,
    PowerLaw,
    Scene,
    Shear,
    Start,
    Trap,
    Vesicle,
)
from solver.scene.ellipses import overlapping_pair

DOCUMENT: dict[str, Any] = {
    "horizon": 100.0,
    "vesicles": [
        {"reduced_area": 0.9, "center": [-1.5, 0.0], "angle": 1.5},
        {"reduced_area": 0.8, "center": [1.5, 0.0], "length": 5.0, "bending_modulus": 2.0},
    ],
    "adhesion": {"hamaker": 1.5, "distance": 0.4, "exponents": [4, 2]},
    "flow": {"kind": "shear", "rate": 0.5},
    "numerics": {"points": 64, "tolerance": 1e-4},
}


def changed(path: str, value: Any) -> dict[str, Any]:
    document: Any = copy.deepcopy(DOCUMENT)
    *parents, last = path.split(".")
    node = document
    for name in parents:
        node = node[int(name)] if isinstance(node, list) else node[name]
    node[int(last) if isinstance(node, list) else last] = value
    return dict(document)


def test_the_document_itself_is_valid() -> None:
    scene = Scene.model_validate(DOCUMENT)
    assert scene.flow == Shear(rate=0.5)
    assert scene.vesicles[0].length == 2 * math.pi
    assert scene.vesicles[1].bending_modulus == 2.0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("horizon", 0.0),
        ("horizon", math.inf),
        ("horizon", math.nan),
        ("horizons", 1.0),
        ("vesicles", []),
        ("vesicles.0.reduced_area", 0.0),
        ("vesicles.1.reduced_area", 1.2),
        ("vesicles.0.reduced_area", math.nan),
        ("vesicles.0.reduced_areas", 0.5),
        ("vesicles.0.length", -1.0),
        ("vesicles.1.bending_modulus", 0.0),
        ("vesicles.0.center", [0.0]),
        ("vesicles.0.center", [1e308, 0.0]),
        ("vesicles.0.center", [0.0, math.nan]),
        ("vesicles.0.angle", math.inf),
        ("adhesion.hamaker", -0.1),
        ("adhesion.distance", 0.0),
        ("adhesion.distance", math.nan),
        ("adhesion.exponents", [4, 2.5]),
        ("adhesion.exponents", [6, 4, 2]),
        ("adhesion.strength", 1.0),
        ("flow.rate", -0.5),
        ("flow.rate", math.nan),
        ("flow.rates", 0.5),
        ("numerics.points", 7),
        ("numerics.points", 65),
        ("numerics.points", 2048),
        ("numerics.tolerance", -1e-4),
        ("numerics.tolerance", 0.5),
        ("numerics.integrator", "euler"),
        ("numerics.work_limit", 0),
        ("criteria", {"revolutions": 0}),
        ("criteria", {"separated_distance": 0.0}),
        ("output", {"interval": 0.0}),
        ("output", {"frame_interval": -1.0}),
        ("start", {"tilt": math.nan}),
    ],
)
def test_a_bad_field_is_named(path: str, value: Any) -> None:
    with pytest.raises(ValidationError) as raised:
        Scene.model_validate(changed(path, value))
    location = list(map(str, raised.value.errors()[0]["loc"]))
    if isinstance(value, dict):
        path += "." + next(iter(value))
    named = [name for name in location if name != "shear"]  # the chosen kind of flow is part of the location
    assert ".".join(named).startswith(path)


def test_a_profile_without_curvature_or_without_width_is_refused() -> None:
    for half_width in (1e-320, 1e300):
        flow = {"kind": "poiseuille", "rate": 1.0, "half_width": half_width}
        with pytest.raises(ValidationError, match=r"(?s)half_width.*0\.000001|half_width.*1000000"):
            Scene.model_validate(changed("flow", flow))


def test_an_unknown_flow_is_named_with_the_known_ones() -> None:
    with pytest.raises(ValidationError, match=r"(?s)flow.*vortex.*shear.*extension.*trap"):
        Scene.model_validate(changed("flow.kind", "vortex"))


@pytest.mark.parametrize("exponents", [[2, 4], [4, 4], [4, 1], [1, 0]])
def test_exponents_out_of_order_are_refused_with_the_rule(exponents: list[int]) -> None:
    with pytest.raises(ValidationError, match="m > n >= 2") as raised:
        Scene.model_validate(changed("adhesion.exponents", exponents))
    assert raised.value.errors()[0]["loc"] == ("adhesion",)


def test_overlapping_vesicles_are_named() -> None:
    with pytest.raises(ValidationError, match=r"vesicles 0 and 1 overlap"):
        Scene.model_validate(changed("vesicles.1.center", [-0.5, 0.3]))


def test_a_vesicle_inside_another_overlaps() -> None:
    small = Vesicle(length=1.0)
    assert overlapping_pair((small, Vesicle())) == (0, 1)
    assert overlapping_pair((Vesicle(), small)) == (0, 1)


@pytest.mark.parametrize(("distance", "overlap"), [(1.99, True), (2.01, False)])
@pytest.mark.parametrize("direction", [0.0, 0.9, 2.2])
def test_circles_overlap_below_two_radii(distance: float, overlap: bool, direction: float) -> None:
    center = (distance * math.cos(direction), distance * math.sin(direction))
    circles = Vesicle(reduced_area=1.0), Vesicle(reduced_area=1.0, center=center)
    assert (overlapping_pair(circles) is not None) is overlap


def test_only_a_pair_can_start_relaxed() -> None:
    with pytest.raises(ValidationError, match=r"start\.relaxed needs exactly 2 vesicles, got 1"):
        Scene(horizon=1.0, vesicles=(Vesicle(),), start=Start(relaxed=True))


def test_scenes_cannot_be_changed() -> None:
    scene = Scene.model_validate(DOCUMENT)
    with pytest.raises(ValidationError, match="frozen"):
        scene.horizon = 5.0  # type: ignore[misc]


FULL = Scene(
    horizon=0.1 + 0.2,
    vesicles=(
        Vesicle(reduced_area=1 / 3, center=(-1.5, 1e-17)),
        Vesicle(center=(1.7, 0.0), angle=-math.pi / 7),
    ),
    adhesion=PowerLaw(hamaker=2 / 3, distance=0.4, exponents=(12, 6)),
    flow=Trap(rate=0.09),
    start=Start(relaxed=True, tilt=1e-2),
    numerics=Numerics(points=96, tolerance=3e-7, integrator="bdf", work_limit=5000),
    criteria=Criteria(separated_distance=8.0, revolutions=3),
    output=Output(interval=0.1, frame_interval=0.7),
)


@pytest.mark.parametrize(
    "scene",
    [
        FULL,
        Scene.model_validate(DOCUMENT),
        Scene(horizon=1.0, vesicles=(Vesicle(),)),
        Scene(horizon=1.0, vesicles=(Vesicle(),), flow=Extension(rate=0.1)),
    ],
)
def test_json_round_trip_is_exact(scene: Scene) -> None:
    assert Scene.model_validate_json(scene.model_dump_json()) == scene
    assert Scene.model_validate(scene.model_dump(mode="json")) == scene


def test_toml() -> None:
    text = """
        horizon = 0.30000000000000004
        [[vesicles]]
        reduced_area = 0.3333333333333333
        center = [-1.5, 1e-17]
        [[vesicles]]
        center = [1.7, 0]
        angle = -0.4487989505128276
        [adhesion]
        hamaker = 0.6666666666666666
        distance = 0.4
        exponents = [12, 6]
        [flow]
        kind = "trap"
        rate = 0.09
        [start]
        relaxed = true
        tilt = 0.01
        [numerics]
        points = 96
        tolerance = 3e-7
        integrator = "bdf"
        work_limit = 5000
        [criteria]
        separated_distance = 8
        revolutions = 3
        [output]
        interval = 0.1
        frame_interval = 0.7
    """
    assert Scene.model_validate(tomllib.loads(text)) == FULL


def test_tables_that_are_left_out_are_absent_or_default() -> None:
    scene = Scene.model_validate({"horizon": 1, "vesicles": [{}]})
    assert scene.adhesion is None
    assert scene.flow is None
    assert scene.vesicles == (Vesicle(),)
    assert scene.numerics == Numerics()
