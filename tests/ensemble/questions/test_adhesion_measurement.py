"""Adhesion is measured from the rate at which a trap ends side by side: what was put in comes out."""

from __future__ import annotations

import json
import math

import pytest

from ensemble.config.documents import load_scene
from ensemble.questions import INCOMPLETE_STATUS
from ensemble.questions.adhesion_measurement import INPUTS, AdhesionMeasurement
from solver.scene import Scene
from tests.benchmarks.adhesion_measurements import critical_rate, measured

FOLD = 0.07702758  # of side by side at reduced area 0.85, H = 0.7 (solver/README.md, section 15)
PAIR = ("--set=vesicles.reduced_area=0.85", "--set=numerics.points=32", "--set=numerics.tolerance=1e-3")
ERRORS = {"flow.rate": 0.05, "units.radius": 0.04, "units.bending_modulus": 0.3, "adhesion.distance": 0.1}

UNITS = {"units.radius": "3 um", "units.bending_modulus": "1e-19 J", "units.viscosity": "1 mPa*s"}
MEASURED = {"flow.rate": f"{FOLD * 1e-19 / (1e-3 * 3e-6**3)!r} 1/s", "adhesion.distance": "1.2 um"}


@pytest.fixture(scope="module")
def document(ensemble, tmp_path_factory):
    """What the command prints for a pair whose adhesion is known, in the units of a laboratory."""
    settings = (f"--set={path}={value}" for path, value in (UNITS | MEASURED).items())
    errors = (f"--error={path}={error}" for path, error in ERRORS.items())
    store = tmp_path_factory.mktemp("measured") / "store"
    result = ensemble("measure-adhesion", *PAIR, *settings, *errors, f"--store={store}", "--json")
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
    assert document["dominant"] == max(errors, key=errors.__getitem__) == "flow.rate"


def test_sensitivities_have_the_dimensions_of_an_energy_per_area(document):
    """W is a product of powers: kilograms, meters and seconds must come out as in J/m²."""
    slopes = document["sensitivities"]
    rate, distance, radius, modulus, viscosity = (
        slopes[path]
        for path in (
            "flow.rate",
            "adhesion.distance",
            "units.radius",
            "units.bending_modulus",
            "units.viscosity",
        )
    )
    assert modulus + viscosity == pytest.approx(1, abs=1e-12)
    assert distance + radius + 2 * modulus - viscosity == pytest.approx(0, abs=1e-12)
    assert -rate - 2 * modulus - viscosity == pytest.approx(-2, abs=1e-12)


@pytest.mark.parametrize(
    ("path", "value", "factor"),
    [("units.radius", "3.003 um", 1.001), ("units.bending_modulus", "1.01e-19 J", 1.01)],
)
def test_errors_are_those_that_another_value_of_an_input_shows(document, path, value, factor):
    """Of the quantities with units, while all other inputs are the same in the laboratory."""
    inputs = UNITS | MEASURED | {path: value}
    settings = [setting.removeprefix("--set=") for setting in PAIR]
    scene = load_scene("doublet-trap", [*settings, *(f"{name}={each}" for name, each in inputs.items())])
    changed = AdhesionMeasurement(scene, {path: 0.5}).answer(None).json_document()
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
    others = math.hypot(
        *(error for path, error in document["relative_errors"].items() if path != "flow.rate")
    )
    step_error = document["sensitivities"]["flow.rate"] * plan["step"] / rate / math.sqrt(12)
    assert step_error <= others * (1 + 1e-12)


@pytest.mark.long
@pytest.mark.parametrize(("hamaker", "reduced_area"), [(0.4, 0.7), (0.7, 0.8), (1.2, 0.9)])
def test_what_was_put_in_comes_out_within_its_error(hamaker: float, reduced_area: float):
    """Rates by continuation in the rate; `tests.benchmarks.adhesion_measurements` has all nine."""
    rate = critical_rate(hamaker, reduced_area)
    found = measured(rate, reduced_area, {})
    assert abs(found["hamaker"] - hamaker) <= found["hamaker_error"] < 1e-4 * hamaker


@pytest.mark.long
def test_another_rate_changes_the_answer_as_its_sensitivity_says():
    found = [measured(rate, 0.8, {}) for rate in (0.094, 0.094 * 1.02)]
    slope = math.log(found[1]["adhesion_energy"] / found[0]["adhesion_energy"]) / math.log(1.02)
    assert slope == pytest.approx(found[0]["sensitivities"]["flow.rate"], abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("doublet-shear",), "flow: a measurement takes a pair in a trap"),
        (("--set=adhesion.cutoff=2.0",), "adhesion.cutoff: a measurement takes a potential without"),
        (
            ("--set=vesicles.0.reduced_area=0.7",),
            "vesicles.reduced_area: the scene must hold exactly one number",
        ),
        (("--error=flow.rate=1.5",), "error: flow.rate=1.5 — must be a fraction"),
        (("--error=flow.rat=0.1",), "did you mean 'flow.rate'?"),
        (("--error=units.radius=0.1",), "error: units.radius — the scene has no units, such as units.radius"),
        (("--error=flow.rate=much",), "error: flow.rate='much' — must be a number"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_one_line(ensemble, arguments, message):
    result = ensemble("measure-adhesion", *arguments, "--no-store")
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_pair_that_nothing_resolves_is_an_answer_with_a_reason(ensemble):
    result = ensemble("measure-adhesion", "--set=adhesion.distance=0.002", "--no-store", "--json")
    assert result.returncode == INCOMPLETE_STATUS
    assert "the run fails" in json.loads(result.stdout)["failure"]


def test_every_input_has_a_place_in_a_scene():
    units = {"radius": "1 um", "bending_modulus": "1e-19 J", "viscosity": "1 mPa*s"}
    scene = load_scene("doublet-trap", [f"units.{name}={value}" for name, value in units.items()])
    assert isinstance(AdhesionMeasurement(scene, dict.fromkeys(INPUTS, 0.1)).scene, Scene)
