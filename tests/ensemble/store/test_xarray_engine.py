"""A store as xarray opens it: everything in one tree, read when it is used, with the points of membranes."""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from ensemble.config.run_key import run_key
from ensemble.errors import StoreError, StoreInputError
from ensemble.store import Store
from ensemble.store.boundary_arrays import boundary_dataset
from solver.analysis.run import Run
from solver.membrane.curve import positions
from tests.ensemble.runs import failed_run, shear_run, shear_scene
from tests.ensemble.search.test_boundary_reading import boundary
from tests.ensemble.store.test_store import write_as_before

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
RUN = shear_run(shear_scene(rate=0.5), frames=12)
BOUNDARY = boundary((0.5, 0.8))


@pytest.fixture
def keys(tmp_path: Path) -> list[str]:
    """Of two runs in the store at `path`, with a boundary."""
    with Store.open(tmp_path / "store") as store:
        store.save_boundary(BOUNDARY)
        return [store.save(RUN), store.save(failed_run())]


@pytest.fixture
def path(tmp_path: Path, keys: list[str]) -> Path:
    return tmp_path / "store"


def exact_points(run: Run) -> tuple[Any, Any]:
    lengths = [vesicle.length for vesicle in run.scene.vesicles]
    points = positions(run.frames.tangent_angle, run.frames.center, lengths)
    return points[..., 0, :], points[..., 1, :]


def test_one_call_opens_runs_and_boundaries(path: Path, keys: list[str]) -> None:
    tree = xarray.open_datatree(path)
    assert list(tree["runs"]) == keys
    run = tree["runs"][keys[0]].dataset
    assert set(run.coords) == {"time", "frame_time", "x", "y"}
    assert run["gap"].dims == ("time",)
    np.testing.assert_array_equal(run["gap"], RUN.series["gap"])
    np.testing.assert_array_equal(run["tension"].sel(frame_time=3.0), RUN.frames.tension[3])
    assert run.attrs["outcome"] == "bound"
    assert run.attrs["scene"] == RUN.scene.model_dump(mode="json")
    assert all({"long_name", "units"} <= array.attrs.keys() for array in run.variables.values())
    xarray.testing.assert_identical(
        tree["boundaries"][BOUNDARY.study_key].to_dataset(), boundary_dataset(BOUNDARY)
    )


def test_x_and_y_are_the_points_of_the_membranes(path: Path, keys: list[str]) -> None:
    run = xarray.open_dataset(path, group=f"runs/{keys[0][:12]}")
    for name, exact in zip("xy", exact_points(RUN), strict=True):
        np.testing.assert_array_equal(run[name], exact)
        np.testing.assert_array_equal(run["tension"].coords[name], exact)
    assert run["x"].attrs["units"] == "R"


@pytest.mark.parametrize(
    "selection",
    [
        (3,),
        (-1, 0),
        (slice(None, None, -3), slice(None), 5),
        (slice(9, 2, -2), 1, slice(None, None, -7)),
        (slice(2, 9, 4),),
        (slice(5, 5),),
        ([4, 1, 1], 0, [0, 31]),
        (slice(None), [True, False]),
    ],
)
def test_parts_are_those_of_the_whole(path: Path, keys: list[str], selection: tuple[Any, ...]) -> None:
    run = xarray.open_datatree(path)["runs"][keys[0]]
    whole = xarray.DataArray(exact_points(RUN)[0], dims=("frame_time", "vesicle", "point"))
    np.testing.assert_array_equal(run["x"][selection], whole[selection])
    tension = whole.copy(data=RUN.frames.tension)
    np.testing.assert_array_equal(run["tension"][selection], tension[selection])


def test_arrays_are_read_when_they_are_used_and_none_stays_open(path: Path, keys: list[str]) -> None:
    run = xarray.open_datatree(path)["runs"][keys[0]]
    np.testing.assert_array_equal(run["gap"], RUN.series["gap"])
    shutil.rmtree(path / "runs" / keys[0])
    np.testing.assert_array_equal(run["gap"], RUN.series["gap"])  # is in memory
    with pytest.raises(StoreError):
        run["x"].load()


def test_conditions_choose_runs_as_they_do_for_query(path: Path, keys: list[str]) -> None:
    assert list(xarray.open_datatree(path, where=["outcome=bound"])["runs"]) == keys[:1]
    assert list(xarray.open_datatree(path, where=["outcome=steady"])["runs"]) == []
    with pytest.raises(StoreInputError, match="colour"):
        xarray.open_datatree(path, where=["colour=red"])


def test_what_is_left_out_is_named_and_what_is_no_store_is_refused(path: Path, tmp_path: Path) -> None:
    assert "tension" not in next(iter(xarray.open_datatree(path, drop_variables="tension")["runs"].values()))
    with pytest.raises(ValueError, match="must be runs/"):
        xarray.open_dataset(path, group="branches/1")
    with pytest.raises(ValueError, match="did not find a match"):
        xarray.open_datatree(tmp_path)


def test_a_run_of_an_earlier_version_opens_alike(tmp_path: Path) -> None:
    with Store.open(tmp_path / "old") as store:
        write_as_before(store.path / "runs" / run_key(RUN.scene), RUN, NOON)
    Store.open(tmp_path / "old").close()
    (run,) = xarray.open_datatree(tmp_path / "old")["runs"].values()
    np.testing.assert_array_equal(run["y"], exact_points(RUN)[1])
    assert run["tension"].attrs["units"] == "R^-2 kappa"
