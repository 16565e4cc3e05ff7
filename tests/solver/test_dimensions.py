"""Numbers with units become those of the scene, and others are refused with the unit that is expected."""

from __future__ import annotations

import gc
import math
import re
import tracemalloc
from itertools import islice, product

import pytest

from solver.dimensions import (
    ADHESION_ENERGY,
    ANGLE,
    BENDING_MODULUS,
    DIMENSIONS,
    ENERGY_PER_DEPTH,
    HAMAKER,
    LENGTH,
    NUMBER,
    RATE,
    TENSION,
    TIME,
    Dimension,
    dimension_of,
    si_value,
)
from solver.scene import Scene, Units

UNITS = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("0.5 1/s", "1/s", 0.5),
        ("0.5/s", "1/s", 0.5),
        ("30 1/min", "1/s", 0.5),
        ("20 s^-1", "1/s", 20.0),
        ("10um", "m", 1e-5),
        ("10 µm", "m", 1e-5),
        ("-2e-3 mm", "m", -2e-6),
        ("3 uJ/m^2", "J/m^2", 3e-6),
        ("3 µN/m", "J/m^2", 3e-6),
        ("1 mPa s", "Pa*s", 1e-3),
        ("25 k * K", "J", 25 * 1.380649e-23),
        ("90 deg", "rad", math.pi / 2),
    ],
)
def test_units_of_laboratories_are_understood(text: str, si: str, value: float) -> None:
    assert si_value(text, si, "") == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3",
        "um",
        "abc",
        "3 bla",
        "3 s",
        "3 degC",
        "3 dB",
        "2 m^9^9^9",
        "2 m^99",
        "2 m; 1",
        "1 m" + " m" * 99,
        "1" * 200_000,
        "1" * 200_000 + " m",
        "1" + " " * 200_000 + "m",
    ],
    ids=lambda text: text[:20],
)
def test_what_is_no_length_is_refused_with_an_example_of_one(text: str) -> None:
    with pytest.raises(ValueError, match=r"must be a number with a unit of length, such as '0\.5 m'"):
        si_value(text, LENGTH.si, LENGTH.name)


def test_scales_are_those_of_the_model() -> None:
    radius, modulus, viscosity = 1e-5, 1e-19, 1e-3
    expected = {
        LENGTH: radius,
        TIME: viscosity * radius**3 / modulus,
        RATE: modulus / (viscosity * radius**3),
        BENDING_MODULUS: modulus,
        ENERGY_PER_DEPTH: modulus / radius,
        TENSION: modulus / radius**2,
        ADHESION_ENERGY: modulus / radius**2,
        HAMAKER: modulus / radius**3,
    }
    assert set(expected) == set(DIMENSIONS)
    for dimension, scale in expected.items():
        assert UNITS.scale(dimension) == pytest.approx(scale, rel=1e-13)
    assert UNITS.scale(NUMBER) == UNITS.scale(ANGLE) == 1


@pytest.mark.parametrize("dimension", DIMENSIONS, ids=lambda each: each.name)
@pytest.mark.parametrize("value", [0.7, 1 / 3, 1234.5678901234, 1e-5])
def test_a_number_keeps_its_value_there_and_back(dimension: Dimension, value: float) -> None:
    in_si = value * UNITS.scale(dimension)
    assert dimension.number(f"{in_si!r} {dimension.si}", UNITS) == pytest.approx(value, rel=1e-12, abs=0)
    factor, unit = UNITS.shown(dimension)
    assert si_value(f"{value * factor!r} {unit.replace('²', '^2')}", dimension.si, "") == pytest.approx(
        in_si, rel=1e-12, abs=0
    )


def test_a_length_stands_for_a_radius() -> None:
    length = Units(length=f"{2 * math.pi * 10!r} um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
    for dimension in DIMENSIONS:
        assert length.scale(dimension) == pytest.approx(UNITS.scale(dimension), rel=1e-13)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("radius", "3 s", "unit of length, such as '0.5 m', got"),
        ("radius", "0 m", "radius\n.*must be at least 1e-30 and at most 1e\\+30 m"),
        ("radius", "1e150 m", "radius\n.*at most 1e\\+30 m"),
        ("radius", "1e-150 m", "radius\n.*at least 1e-30"),
        ("bending_modulus", "1e300 J", "bending_modulus\n.*at most 1e\\+30 J"),
        ("viscosity", "1e-300 Pa s", "viscosity\n.*at most 1e\\+30 Pa\\*s"),
        ("viscosity", "1e999 Pa s", "viscosity\n.*at most 1e\\+30 Pa\\*s"),
        ("bending_modulus", "1e-19 m", "unit of bending modulus, such as '0.5 J', got"),
        ("viscosity", "1", "unit of viscosity, such as '0.5 Pa\\*s'"),
        ("length", "60 um", "either radius or length"),
    ],
)
def test_units_are_checked(field: str, value: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Units.model_validate(UNITS.model_dump() | {field: value})


@pytest.mark.parametrize("radius", ["1e-30 m", "1e30 m"])
@pytest.mark.parametrize("bending_modulus", ["1e-30 J", "1e30 J"])
@pytest.mark.parametrize("viscosity", ["1e-30 Pa*s", "1e30 Pa*s"])
def test_all_that_follow_from_units_at_their_limits_are_numbers(
    radius: str, bending_modulus: str, viscosity: str
) -> None:
    units = Units(radius=radius, bending_modulus=bending_modulus, viscosity=viscosity)
    for dimension in DIMENSIONS:
        assert 0 < units.scale(dimension) < math.inf
        assert 0 < units.shown(dimension)[0] < math.inf


@pytest.mark.parametrize("text", ["1" * 200_000 + "x", "1." + "1" * 200_000 + "x"], ids=["whole", "decimal"])
def test_a_long_text_is_refused_as_a_number_of_a_scene(text: str) -> None:
    """Also by the pattern that clients of the service check: its time is not the square of the length."""
    with pytest.raises(ValueError, match=r"horizon\n.*should be a valid number"):
        Scene.model_validate({"units": UNITS, "horizon": text, "vesicles": [{}]}, context={})
    quantity = Scene.model_json_schema()["properties"]["horizon"]["anyOf"][1]
    assert re.match(quantity["pattern"], text)
    assert re.match(quantity["pattern"], text[:-1]) is None
    assert quantity["maxLength"] < len(text)


def test_different_units_are_not_kept_for_ever() -> None:
    """A service is sent any number of them."""
    prefixes = ("", "k", "m", "u", "n", "p", "c", "d", "M", "G", "da", "h")
    texts = (f"1 {a}m*{b}s*{c}g/s/g" for a, b, c in product(prefixes, repeat=3))
    kept = []
    tracemalloc.start()
    try:
        for _ in range(3):
            for text in islice(texts, 200):
                si_value(text, LENGTH.si, LENGTH.name)
            gc.collect()
            kept.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert kept[2] < kept[0] + 400 * 200  # bytes; unbounded it is over a kilobyte for each of the last 400


def test_every_length_time_and_rate_of_a_scene_states_its_dimension() -> None:
    """By their names, so that none loses it."""
    stated = {"horizon", "rate", "distance", "cutoff", "hamaker", "adhesion_energy", "length", "center"}
    stated |= {"bending_modulus", "angle", "tangent_angle", "tilt", "interval", "frame_interval"}
    stated |= {"separated_distance", "steady_rate", "steady_time"}
    document = {"adhesion": {"hamaker": 1, "distance": 1}, "flow": {"kind": "trap", "rate": 1}}
    scene = Scene.model_validate({"horizon": 1.0, "vesicles": [{}]} | document)
    parts = (scene.vesicles[0], scene.adhesion, scene.flow, scene.start, scene.output, scene.criteria)
    found = set()
    for model in (scene, *parts):
        for name, field in type(model).model_fields.items():
            if any(isinstance(each, Dimension) for each in field.metadata) or dimension_of(field.annotation):
                found.add(name)
    assert found - {"arrangement", "vesicles"} == stated
