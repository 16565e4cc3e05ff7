"""Scenes and studies with units are those without, and their numbers have units again when they are shown."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from ensemble.config.documents import load_scene, load_study, load_units, preset_document
from ensemble.config.measured import Measured, dimension_at, measured_fields
from ensemble.config.overrides import override
from ensemble.config.run_key import run_key
from ensemble.config.study import Study
from ensemble.config.validation import validated
from ensemble.search.branch_summary import branch_key
from solver.dimensions import ENERGY_PER_DEPTH, LENGTH, RATE
from solver.scene import Scene, Units

UNITS = {"radius": "10 um", "bending_modulus": "1e-19 J", "viscosity": "1 mPa*s"}
STATED = [f"units.{name}={value}" for name, value in UNITS.items()]
OF_STUDY = [f"scene.{change}" for change in STATED]
MEASURED: dict[str, Any] = {
    "units": UNITS,
    "horizon": "1000 s",
    "vesicles": [
        {"center": ["-15 um", "0 m"], "angle": "90 deg", "length": 6.0, "bending_modulus": "2e-19 J"},
        {"center": [1.5, 0.0]},
    ],
    "adhesion": {"hamaker": "70 uPa", "distance": "4 um", "cutoff": "20 um"},
    "flow": {"kind": "shear", "rate": "3 1/min"},
    "start": {"tilt": "0.1 rad"},
    "criteria": {"separated_distance": "0.12 mm", "steady_time": "50 s", "steady_rate": "1e-6 1/s"},
    "output": {"interval": "5 s"},
}
TWIN: dict[str, Any] = {
    "horizon": 100.0,
    "vesicles": [{"center": [-1.5, 0.0], "length": 6.0, "bending_modulus": 2.0}, {"center": [1.5, 0.0]}],
    "adhesion": {"hamaker": 0.7, "distance": 0.4, "cutoff": 2.0},
    "flow": {"kind": "shear", "rate": 0.5},
    "start": {"tilt": 0.1},
    "criteria": {"separated_distance": 12.0, "steady_time": 5.0, "steady_rate": 1e-5},
    "output": {"interval": 0.5},
}


def test_a_scene_with_units_is_its_twin_without() -> None:
    scene, twin = validated(Scene, MEASURED), validated(Scene, TWIN)
    assert scene.units == Units.model_validate(UNITS)
    assert scene.model_copy(update={"units": None}) == twin
    assert run_key(scene) == run_key(twin)
    assert branch_key(scene, "flow.rate", None) == branch_key(twin, "flow.rate", None)


def test_keys_stay_as_they_are() -> None:
    """A store finds its runs by them: they change with results and with fields of the scene only."""
    scene = load_scene("doublet-shear", ["horizon=10", "adhesion.hamaker=0.7"])
    assert run_key(scene) == "35304503bb96f66f54a1178d46e0c592"
    assert load_study("critical-hamaker").key == "c2ec155a82590254"


def test_the_vesicles_of_an_arrangement_have_units_too() -> None:
    document = {
        "units": UNITS,
        "horizon": 1.0,
        "arrangement": {
            "kind": "random",
            "count": 3,
            "area_fraction": 0.1,
            "minimum_distance": "3 um",
            "length": {"kind": "uniform", "low": "50 um", "high": "70 um"},
        },
    }
    twin = copy.deepcopy(document)
    twin["arrangement"] |= {"minimum_distance": 0.3, "length": {"kind": "uniform", "low": 5.0, "high": 7.0}}
    assert validated(Scene, document) == validated(Scene, twin)


def test_a_study_takes_units_in_limits_values_and_guesses() -> None:
    measured = load_study(
        "critical-hamaker",
        [
            *OF_STUDY,
            "name=measured",
            'sweep.values=["0.05 1/s", 1.0]',
            'search.limits=["10 uPa", "500 uPa"]',
            'search.guesses=[{at = "0.05 1/s", bracket = ["20 uPa", 0.5]}]',
        ],
    )
    twin = load_study(
        "critical-hamaker",
        [
            "name=measured",
            "sweep.values=[0.5, 1.0]",
            "search.limits=[0.1, 5.0]",
            "search.guesses=[{at = 0.5, bracket = [0.2, 0.5]}]",
        ],
    )
    assert (measured.sweep, measured.search, measured.key) == (twin.sweep, twin.search, twin.key)
    assert measured.scene_at((0.5,), 0.3).units == measured.scene.units


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            "flow.rate=3 um",
            "flow.rate: '3 um' — must be a number with a unit of rate, such as '0.5 1/s', got",
        ),
        ("adhesion.distance=3 s", "adhesion.distance: '3 s' — must be a number with a unit of length"),
        ("vesicles.0.angle=3 m", "vesicles.0.angle: '3 m' — must be a number with a unit of angle"),
        ("vesicles.reduced_area=3 m", "vesicles.0.reduced_area: '3 m' — input should be a valid number"),
        ("horizon=-3 s", "horizon: -0.3 — input should be greater than 0"),
    ],
)
def test_another_dimension_is_refused_with_the_field_and_the_unit(change: str, message: str) -> None:
    with pytest.raises(ValueError, match=message.replace(".", r"\.")):
        load_scene("doublet-shear", [*STATED, change])


def test_limits_of_another_dimension_are_refused() -> None:
    with pytest.raises(ValueError, match=r"search\.limits\.1: '5 m' — must be .* Hamaker constant"):
        load_study("critical-hamaker", [*OF_STUDY, 'search.limits=["10 uPa", "5 m"]'])


def test_a_unit_needs_the_units_of_the_scene() -> None:
    with pytest.raises(
        ValueError,
        match=r"flow\.rate: '0\.5 1/s' — a unit needs those of the scene: units\.radius .* units\.viscosity",
    ):
        load_scene("doublet-shear", ["flow.rate=0.5 1/s"])
    assert load_scene("doublet-shear", ["vesicles.0.angle=90 deg"]) == load_scene("doublet-shear")


def test_an_energy_takes_the_place_of_the_hamaker_constant() -> None:
    scene = load_scene("doublet-shear", [*STATED, "adhesion.adhesion_energy=1 nJ/m^2"])
    back = override(scene.model_dump(), {"adhesion.hamaker": 0.7})
    assert scene.adhesion is not None
    assert scene.adhesion.hamaker == pytest.approx(1 / (4.8367983 * 0.4), rel=1e-7)
    assert validated(Scene, back).adhesion == load_scene("doublet-shear", ["adhesion.hamaker=0.7"]).adhesion


@pytest.mark.parametrize("first", ["adhesion.hamaker=0.7", "adhesion={hamaker = 0.7, distance = 0.4}"])
def test_two_strengths_in_one_set_of_changes_are_refused(first: str) -> None:
    with pytest.raises(ValueError, match="adhesion: give either hamaker or adhesion_energy"):
        load_scene("doublet-shear", [first, "adhesion.adhesion_energy=1.0"])
    with pytest.raises(ValueError, match="adhesion: give either hamaker or adhesion_energy"):
        load_study(
            "critical-extension-rate",
            [f"scene.{first}", "scene.adhesion.adhesion_energy=1.0"],
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("units.radius=1e150 m", r"units\.radius: '1e150 m' — must be at least 1e-30 and at most 1e\+30 m"),
        ("units.radius=1e-150 m", r"units\.radius: '1e-150 m' — must be at least"),
        ("adhesion.distance=1e300", r"adhesion: distance 1e\+300 is too small or too large"),
        ("adhesion.distance=1e-300 m", r"adhesion: distance 1e-295 is too small or too large"),
        ("adhesion.adhesion_energy=1e300", r"adhesion: adhesion_energy 1e\+300 is too small or too large"),
    ],
)
def test_numbers_beyond_what_can_be_computed_are_refused_by_their_name(change: str, message: str) -> None:
    energy = [] if "energy" in change else ["adhesion.adhesion_energy=1.0"]
    distance = ["adhesion.distance=1e-20"] if energy == [] else []
    with pytest.raises(ValueError, match=message):
        load_scene("doublet-shear", [*STATED, *energy, *distance, change])


def test_all_numbers_of_a_scene_are_shown_with_their_units() -> None:
    scene = validated(Scene, MEASURED)
    shown = measured_fields(scene, scene.model_dump(mode="json"), scene.units)
    assert {path: str(shown[path]) for path in ("horizon", "flow.rate", "adhesion.distance")} == {
        "horizon": "1000 s",
        "flow.rate": "0.05 1/s",
        "adhesion.distance": "4 µm",
    }
    assert shown["vesicles.0.center"] == Measured([-15.0, 0.0], "µm")
    assert "vesicles.0.reduced_area" not in shown
    assert "vesicles.0.angle" not in shown
    assert measured_fields(scene, scene.model_dump(), None) == {}


def test_dimensions_are_found_by_dotted_path() -> None:
    scene = validated(Scene, TWIN)
    assert dimension_at(scene, "flow.rate") == RATE
    assert dimension_at(scene, "vesicles.length") == dimension_at(scene, "vesicles.1.center.0") == LENGTH
    assert dimension_at(scene, "vesicles.reduced_area") is None
    assert dimension_at(scene, "nothing.there") is None
    assert ENERGY_PER_DEPTH.symbol == "R^-1 kappa"


def test_units_are_read_from_scenes_and_studies(tmp_path) -> None:
    table = "\n".join(f'{name} = "{value}"' for name, value in UNITS.items())
    (tmp_path / "scene.toml").write_text(f"[units]\n{table}\n")
    (tmp_path / "study.toml").write_text(f"[scene.units]\n{table}\n")
    assert load_units(tmp_path / "scene.toml") == load_units(tmp_path / "study.toml")
    with pytest.raises(ValueError, match="units — its scene has no such table"):
        load_units("doublet-shear")


def test_every_study_of_the_presets_keeps_its_key_with_units() -> None:
    document = preset_document("critical-extension-rate")
    measured = copy.deepcopy(document)
    measured["scene"]["units"] = UNITS
    assert validated(Study, measured).key == validated(Study, document).key
