"""Units on the command line: what is asked with them is answered in both."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray
from zarr.storage import ZipStore

UNITS = ("--set=units.radius=10 um", "--set=units.bending_modulus=1e-19 J", "--set=units.viscosity=1 mPa*s")
SHORT = ("--set=numerics.points=32", "--set=numerics.tolerance=1e-3")


@pytest.fixture(scope="module")
def made(ensemble, tmp_path_factory):
    """A store with a run of ten seconds, and the document that was printed."""
    store = tmp_path_factory.mktemp("units") / "store"
    arguments = ("doublet-shear", *SHORT, *UNITS, "--set=horizon=10 s", "--set=flow.rate=3 1/min")
    result = ensemble("run", *arguments, f"--store={store}", "--json")
    assert result.returncode == 0, result.stderr
    return store, json.loads(result.stdout)


def test_a_run_is_answered_in_both(made):
    _, document = made
    assert document["time"] == 1.0
    assert document["in_units"]["time"] == {"value": 10.0, "unit": "s"}
    assert document["in_units"]["gap"]["unit"] == "µm"
    assert document["in_units"]["gap"]["value"] == pytest.approx(10 * document["gap"], rel=1e-12)
    assert "error.area" not in document["in_units"]


def test_its_twin_without_units_is_the_same_run(ensemble, made):
    store, document = made
    arguments = ("doublet-shear", *SHORT, "--set=horizon=1.0", "--set=flow.rate=0.5")
    twin = json.loads(ensemble("run", *arguments, f"--store={store}", "--json").stdout)
    assert twin["run_key"] == document["run_key"]
    assert "in_units" not in twin
    table = ensemble("run", *arguments, *UNITS, f"--store={store}").stdout
    assert "time\t1\t10 s" in table


def test_a_stored_run_is_shown_in_its_units_or_in_others(ensemble, made, tmp_path: Path):
    store, document = made
    (tmp_path / "smaller.toml").write_text(
        '[units]\nradius = "5 um"\nbending_modulus = "1e-19 J"\nviscosity = "1 mPa*s"\n'
    )
    show = ("show", document["run_key"], f"--store={store}")
    assert "scene.flow.rate\t0.5\t0.05 1/s" in ensemble(*show).stdout
    others = (*show, f"--units={tmp_path / 'smaller.toml'}")
    assert "scene.flow.rate\t0.5\t0.4 1/s" in ensemble(*others).stdout
    assert json.loads(ensemble(*others, "--json").stdout)["in_units"]["time"] == {"value": 1.25, "unit": "s"}
    drawn = ensemble(*others, f"--output={tmp_path / 'run.svg'}")
    assert drawn.returncode == 0, drawn.stderr
    refused = ensemble(*show, "--units=doublet-shear")
    assert refused.returncode == 2
    assert "units — its scene has no such table" in refused.stderr


def test_xarray_sees_both_units(ensemble, made, tmp_path: Path):
    store, document = made
    archive = ZipStore(store / "runs" / document["run_key"] / "zarr.zip", mode="r")
    with xarray.open_zarr(archive, consolidated=False) as run:
        assert run["gap"].attrs["units"] == "R"
        assert (run["time"].attrs["si_units"], run["time"].attrs["si_factor"]) == ("s", 10.0)
        assert (run["tension"].attrs["si_units"], run["tension"].attrs["si_factor"]) == ("N/m", 1e-9)
        assert run.attrs["scene"]["units"]["radius"] == "10 um"
    assert (
        ensemble("export", document["run_key"], str(tmp_path / "run.h5"), f"--store={store}").returncode == 0
    )
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as run:
        assert (run["gap"].attrs["si_units"], run["gap"].attrs["si_factor"]) == ("m", 1e-5)


def test_the_units_of_a_scene_and_its_numbers_are_listed(ensemble):
    result = ensemble("units", "doublet-shear", *UNITS, "--set=adhesion.adhesion_energy=1 nJ/m^2", "--json")
    rows = {row["name"]: row for row in json.loads(result.stdout)}
    assert (rows["time"]["value"], rows["time"]["unit"]) == (10.0, "s")
    assert (rows["tension"]["value"], rows["tension"]["unit"]) == (1.0, "nN/m")
    assert (rows["flow.rate"]["in_scene"], rows["flow.rate"]["value"]) == (0.5, 0.05)
    energy = rows["adhesion energy of flat membranes"]
    assert energy["value"] == pytest.approx(1.0, rel=1e-12)
    assert rows["their distance"]["value"] == pytest.approx(4 * 0.75**0.5, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("units", "doublet-shear"), "units — the scene has no such table"),
        (("run", "doublet-shear", *UNITS, "--set=flow.rate=1 m"), "flow.rate: '1 m' — must be a number"),
        (("run", "doublet-shear", "--set=flow.rate=1 1/s"), "flow.rate: '1 1/s' — a unit needs those of"),
        (("run", "doublet-shear", "--set=units.radius=1 m"), "units.bending_modulus: field required"),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(ensemble, arguments, message):
    result = ensemble(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
