"""`ensemble start-from`: scenes that hold the shapes of a stored run, or of files, as numbers."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from ensemble import Store
from ensemble.config.documents import load_scene
from ensemble.config.run_key import run_key
from solver import simulate
from solver.scene.outlines import outline

ANGLE = 2 * np.pi * np.arange(80) / 80
BEAN = np.column_stack(
    [3 + 2 * np.cos(ANGLE), np.sin(ANGLE) * (1 + 0.3 * np.cos(ANGLE)) + 0.2 * np.cos(ANGLE)]
)


@pytest.fixture(scope="module")
def start_from(ensemble) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the command in a directory."""

    def run(directory: Path, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return ensemble("start-from", *map(str, arguments), cwd=directory)

    return run


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A store in the usual place, with one run of a pair."""
    directory = tmp_path_factory.mktemp("given")
    scene = load_scene("doublet-shear", ["horizon=6.0", "output.frame_interval=2.0", "numerics.points=32"])
    with Store.open(directory / "ensemble-store") as opened:
        return directory, opened.save(simulate(scene))


def test_a_scene_starts_from_a_stored_run(start_from, store: tuple[Path, str], tmp_path: Path) -> None:
    directory, key = store
    done = start_from(
        directory, key[:12], "--time=4.3", "--turn=90 deg", "--shift", "1", "2", "--set=flow.rate=0.25"
    )
    assert done.returncode == 0, done.stderr
    assert "the state at time 4\n" in done.stderr
    assert "reduced area 0.9" in done.stderr
    document = tmp_path / "scene.toml"
    document.write_text(done.stdout)
    scene = load_scene(document)
    assert scene.flow is not None
    assert scene.flow.rate == 0.25
    assert not scene.start.relaxed
    with Store.existing(directory / "ensemble-store") as opened:
        frames = opened.load(key).frames
    places = frames.center[2] @ np.array([[0, 1], [-1, 0]]) + [1, 2]
    np.testing.assert_allclose([vesicle.center for vesicle in scene.vesicles], places, atol=1e-12)
    np.testing.assert_array_equal(scene.vesicles[1].tangent_angle, frames.tangent_angle[2, 1])
    assert scene.vesicles[0].angle == pytest.approx(np.pi / 2)
    assert simulate(scene.model_copy(update={"horizon": 0.1})).failure is None


def test_another_state_is_another_scene(start_from, store: tuple[Path, str], tmp_path: Path) -> None:
    keys = set()
    for number, time in enumerate((2, 2, 4)):
        document = tmp_path / f"{number}.toml"
        document.write_text(start_from(store[0], store[1], f"--time={time}").stdout)
        keys.add(run_key(load_scene(document)))
    assert len(keys) == 2


@pytest.mark.parametrize("suffix", [".csv", ".CSV", ".txt", ".npy", ".h5"])
def test_a_vesicle_takes_its_shape_from_a_file(start_from, suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"bean{suffix}"
    if suffix == ".npy":
        np.save(file, BEAN)
    elif suffix == ".h5":
        with h5py.File(file, "w") as opened:
            opened["cells/first"] = BEAN
            opened["time"] = np.arange(3)
    elif suffix.lower() == ".csv":
        np.savetxt(file, BEAN, delimiter=",", header="x,y", comments="")
    else:
        np.savetxt(file, BEAN)
    done = start_from(tmp_path, file.name, "--scene=vesicle-shear")
    assert done.returncode == 0, done.stderr
    assert "no point is farther than" in done.stderr
    document = tmp_path / "scene.toml"
    document.write_text(done.stdout)
    (vesicle,) = load_scene(document).vesicles
    assert f"length {vesicle.length:.6g}, reduced area {vesicle.reduced_area:.6g}" in done.stderr
    drawn = outline(vesicle)
    distances = np.abs((BEAN @ [1, 1j])[:, None] - drawn[None]).min(axis=1)
    assert distances.max() < vesicle.length / drawn.size
    assert simulate(load_scene(document, ["horizon=0.2"])).failure is None


def test_points_in_a_unit(start_from, tmp_path: Path) -> None:
    np.save(tmp_path / "bean.npy", 10 * BEAN)
    scene = tmp_path / "units.toml"
    text = "horizon = 1.0\nvesicles = [{}]\n"
    text += "units = {radius = '10 um', bending_modulus = '1e-19 J', viscosity = '1 mPa*s'}\n"
    scene.write_text(text)
    written = start_from(tmp_path, "bean.npy", f"--scene={scene}", "--unit=um")
    assert written.returncode == 0, written.stderr
    document = tmp_path / "scene.toml"
    document.write_text(written.stdout)
    found = load_scene(document)
    np.save(tmp_path / "plain.npy", BEAN)
    plain = tmp_path / "plain.toml"
    plain.write_text(start_from(tmp_path, "plain.npy", f"--scene={scene}").stdout)
    assert found.vesicles[0].length == pytest.approx(load_scene(plain).vesicles[0].length, rel=1e-12)
    assert found.units is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none.csv", "--scene=vesicle-shear"), "'none.csv' is no file"),
        (("words.csv", "--scene=vesicle-shear"), "words.csv: every line must have two numbers"),
        (("bean.csv",), "--scene"),
        (("bean.csv", "--scene=doublet-shear"), "2 vesicles, and there are 1 files"),
        (
            ("bean.csv", "--scene=vesicle-shear", "--turn=3 m"),
            "--turn: '3 m' — must be a number",
        ),
        (("bean.csv", "--scene=vesicle-shear", "--turn=1e400"), "--turn: '1e400' — must be from"),
        (
            ("bean.csv", "--scene=vesicle-shear", "--shift", "0", "nan"),
            "--shift: 0 nan — must be from",
        ),
        (
            ("bean.csv", "--scene=vesicle-shear", "--unit=um"),
            "--unit: 'um' — a unit needs those of the scene",
        ),
        (("bean.csv", "--scene=vesicle-shear", "--time=3"), "--time — is one of a stored run"),
        (("bean.csv", "--scene=vesicle-shear", "--store=runs"), "--store — is that of stored runs"),
        (
            ("bean.csv", "--scene=critical-hamaker"),
            "--scene: critical-hamaker is a study, and must be a scene",
        ),
        (("abc", "bean.csv", "--scene=doublet-shear"), "'bean.csv' is a file, and 'abc' is none"),
        (("huge.csv", "--scene=vesicle-shear"), "huge.csv: points must lie within 1e+100 of the origin"),
        (("bean.csv", "bean.csv", "--scene=doublet-shear"), "vesicles 0 and 1 overlap"),
        (("bean.csv", "--scene=vesicle-shear", "--set=vesicles.reduced_area=0.5"), "reduced_area is 0.5"),
    ],
)
def test_bad_input_is_refused_in_a_line(
    start_from, arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    np.savetxt(tmp_path / "bean.csv", BEAN, delimiter=",")
    np.savetxt(tmp_path / "huge.csv", 1e200 * BEAN, delimiter=",")
    (tmp_path / "words.csv").write_text("x,y\n1,2,3\n")
    done = start_from(tmp_path, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert message in done.stderr.splitlines()[-1]
    assert "Warning" not in done.stderr


def test_the_unit_of_points_is_none_of_a_run(start_from, store: tuple[Path, str]) -> None:
    done = start_from(store[0], store[1], "--unit=um")
    assert done.returncode == 2
    assert "--unit — is that of points in files" in done.stderr


def test_it_is_said_that_a_protocol_begins_anew(start_from, store: tuple[Path, str]) -> None:
    assert "protocol" not in start_from(store[0], store[1]).stderr
    done = start_from(
        store[0], store[1], '--set=protocol={kind = "ramp", start = 0.0, end = 1.0, duration = 4.0}'
    )
    assert done.returncode == 0, done.stderr
    assert "the protocol of the flow begins at time 0 of the new run" in done.stderr


def test_a_time_that_the_run_does_not_have_is_refused(start_from, store: tuple[Path, str]) -> None:
    done = start_from(store[0], store[1], "--time=7")
    assert done.returncode == 2
    assert "time must be from 0 to 6" in done.stderr
