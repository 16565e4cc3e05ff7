"""Adhesion is measured from the rate at which a trap ends side by side: what was put in comes out."""

from __future__ import annotations

import json
import math
import re

import pytest

from ensemble.config.adhesion_measurement import INPUTS
from ensemble.config.documents import load_scene
from ensemble.config.dotted_paths import parameter_value
from ensemble.config.overrides import parse_override
from ensemble.questions import INCOMPLETE_STATUS
from ensemble.questions.measurement_question import MeasurementQuestion
from tests.benchmarks.adhesion_measurements import answer_about, critical_rate, measured

FOLD = 0.07702758  # of side by side at reduced area 0.85, H = 0.7 (solver/README.md, section 15)
PAIR = ("vesicles.reduced_area=0.85", "numerics.points=32", "numerics.tolerance=1e-3")
ERRORS = {"rate": 0.05, "radius": 0.04, "bending_modulus": 0.3, "distance": 0.1}

UNITS = {"units.radius": "3 um", "units.bending_modulus": "1e-19 J", "units.viscosity": "1 mPa*s"}
MEASURED = {"flow.rate": f"{FOLD * 1e-19 / (1e-3 * 3e-6**3)!r} 1/s", "adhesion.distance": "1.2 um"}


@pytest.fixture(scope="module")
def document(ensemble, tmp_path_factory):
    """What the command prints for a pair whose adhesion is known, in the units of a laboratory."""
    changes = [f"scene.{change}" for change in (*PAIR, *map("=".join, (UNITS | MEASURED).items()))]
    changes += [f"errors.{name}={ERRORS.get(name, 0)}" for name in INPUTS]
    store = tmp_path_factory.mktemp("measured") / "store"
    settings = [f"--set={change}" for change in changes]
    result = ensemble("measure-adhesion", *settings, f"--store={store}", "--json")
    assert result.returncode == 0, result.stderr
    shown = ensemble("show", json.loads(result.stdout)["branch_key"], f"--store={store}")
    assert shown.returncode == 0, shown.stderr
    return json.loads(result.stdout)


def test_the_adhesion_of_a_known_fold_is_found(document):
    numerics = document["relative_errors"]["numerics"]
    assert numerics < 1e-5
    # The fold is known to its last digit.
    assert document["hamaker"] == pytest.approx(0.7, rel=2 * numerics + 0.5e-8 / FOLD)
    assert document["lost_at"] == "fold"
    energy = document["in_units"]["adhesion_energy"]
    assert energy["unit"] == "nJ/m²"
    assert energy["value"] == pytest.approx(4.8367983 * 0.7 * 0.4 * 1e-19 / 3e-6**2 * 1e9, rel=1e-5)


def test_the_error_is_that_of_all_inputs_and_the_largest_is_named(document):
    errors, slopes = document["relative_errors"], document["sensitivities"]
    assert errors.keys() == ERRORS.keys() | {"numerics"}
    for path, error in ERRORS.items():
        assert errors[path] == pytest.approx(abs(slopes[path]) * error, rel=1e-12)
    assert document["adhesion_energy_error"] == pytest.approx(
        document["adhesion_energy"] * math.hypot(*errors.values()), rel=1e-12
    )
    assert document["dominant"] == max(errors, key=errors.__getitem__) == "rate"


def test_sensitivities_have_the_dimensions_of_an_energy_per_area(document):
    """W is a product of powers: kilograms, meters and seconds must come out as in J/m²."""
    slopes = document["sensitivities"]
    rate, distance, radius, modulus, viscosity = (
        slopes[path] for path in ("rate", "distance", "radius", "bending_modulus", "viscosity")
    )
    assert modulus + viscosity == pytest.approx(1, abs=1e-12)
    assert distance + radius + 2 * modulus - viscosity == pytest.approx(0, abs=1e-12)
    assert -rate - 2 * modulus - viscosity == pytest.approx(-2, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "factor"),
    [("radius", "3.003 um", 1.001), ("bending_modulus", "1.01e-19 J", 1.01)],
)
def test_errors_are_those_that_another_value_of_an_input_shows(document, name, value, factor):
    """Of the quantities with units, while all other inputs are the same in the laboratory."""
    inputs = UNITS | MEASURED | {INPUTS[name]: value}
    changed = answer_about(load_scene("doublet-trap", [*PAIR, *map("=".join, inputs.items())]), **{name: 0.5})
    assert {type(each) for each in changed["plan"].values()} == {float}
    for name in ("hamaker", "adhesion_energy"):
        before, after = (each["in_units"][name] for each in (document, changed))
        assert before["unit"] == after["unit"]
        slope = math.log(after["value"] / before["value"]) / math.log(factor)
        assert changed[f"{name}_error"] / changed[name] == pytest.approx(0.5 * abs(slope), abs=2e-3)


def test_the_plan_looks_around_the_critical_rate_and_waits_for_the_slowest_motion(document):
    plan, rate = document["plan"], document["critical_rate"]
    assert plan["from"] < rate < plan["to"]
    assert plan["to"] - plan["from"] >= 4 * plan["step"] * (1 - 1e-12) > 0
    assert document["in_units"]["plan.hold"]["unit"] == "s"
    others = math.hypot(*(error for name, error in document["relative_errors"].items() if name != "rate"))
    step_error = document["sensitivities"]["rate"] * plan["step"] / rate / math.sqrt(12)
    assert step_error <= others * (1 + 1e-12)


@pytest.mark.long
@pytest.mark.parametrize(("hamaker", "reduced_area"), [(0.4, 0.7), (0.7, 0.8), (1.2, 0.9)])
def test_what_was_put_in_comes_out_within_its_error(hamaker: float, reduced_area: float):
    """Rates by continuation in the rate; `tests.benchmarks.adhesion_measurements` has all nine."""
    rate = critical_rate(hamaker, reduced_area)
    found = measured(rate, reduced_area)
    assert abs(found["hamaker"] - hamaker) <= found["hamaker_error"] < 1e-4 * hamaker


@pytest.mark.long
def test_another_rate_changes_the_answer_as_its_sensitivity_says():
    found = [measured(rate, 0.8) for rate in (0.094, 0.094 * 1.02)]
    slope = math.log(found[1]["adhesion_energy"] / found[0]["adhesion_energy"]) / math.log(1.02)
    assert slope == pytest.approx(found[0]["sensitivities"]["rate"], abs=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('scene.flow={kind = "shear", rate = 0.5}', "scene.flow: a measurement takes a pair in a trap"),
        ("scene.adhesion.cutoff=2.0", "scene.adhesion.cutoff: a measurement takes a potential without"),
        ("scene.vesicles.0.reduced_area=0.7", "scene.vesicles.reduced_area: the scene must hold exactly one"),
        ("errors.rate=1.5", "errors.rate: 1.5 — input should be less than 1"),
        ("errors.rat=0.1", "did you mean 'rate'?"),
        ("errors.rate=much", "errors.rate: 'much' — "),
    ],
)
def test_what_cannot_be_measured_is_refused(change, message):
    path, value = change.split("=", 1)
    with pytest.raises(ValueError, match=re.escape(message)):
        MeasurementQuestion.load("adhesion-measurement", dict([parse_override(f"{path}={value}")]))


def test_an_error_of_a_unit_needs_units():
    with pytest.raises(ValueError, match=r"errors\.radius: the scene has no units, such as units.radius"):
        answer_about(load_scene("doublet-trap", []), radius=0.1)


def test_a_scene_is_refused_in_one_line(ensemble):
    result = ensemble("measure-adhesion", "doublet-trap", "--no-store")
    assert result.returncode == 2
    assert result.stderr == "ensemble: doublet-trap: this is a scene: use ensemble run\n"


def test_a_pair_that_nothing_resolves_is_an_answer_with_a_reason(ensemble):
    result = ensemble("measure-adhesion", "--set=scene.adhesion.distance=0.002", "--no-store", "--json")
    assert result.returncode == INCOMPLETE_STATUS
    document = json.loads(result.stdout)
    assert "the run fails" in document["failure"]
    assert MeasurementQuestion.summary(document) == document["failure"]


def test_the_answer_in_a_few_words_has_units_where_they_are_known(document):
    """As the page and the list of jobs show it."""
    text = MeasurementQuestion.summary(document)
    energy, error = (
        document["in_units"][name]["value"] for name in ("adhesion_energy", "adhesion_energy_error")
    )
    assert f"energy per area {energy:.4g} nJ/m² ± {error:.4g} nJ/m²" in text
    assert "most of the error comes from rate" in text
    without = {name: value for name, value in document.items() if name != "in_units"}
    assert f"H = {document['hamaker']:.4g} ± {document['hamaker_error']:.4g}," in MeasurementQuestion.summary(
        without
    )


def test_every_input_has_a_place_in_the_scene():
    question = MeasurementQuestion.load("adhesion-measurement", {})
    units = question.document.scene.units
    assert units is not None
    for path in INPUTS.values():
        if path.startswith("units."):
            assert hasattr(units, path.removeprefix("units."))
        else:
            assert parameter_value(question.document.scene, path) > 0
