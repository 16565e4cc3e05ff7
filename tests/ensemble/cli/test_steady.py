"""`ensemble steady` and `ensemble continue`: their documents, what is refused, and the store of branches."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import xarray
from zarr.storage import ZipStore

from ensemble.figures.bifurcation import bifurcation_diagram
from ensemble.questions import INCOMPLETE_STATUS
from ensemble.questions.branches import StoredBranches
from ensemble.store import Store, StoreError, StoreInputError
from ensemble.store.listing import Listing
from ensemble.store.repair import repair
from tests.ensemble.group_files import unpacked

TREADING = (
    "vesicle-shear",
    "--set=vesicles.reduced_area=0.8",
    "--set=flow.rate=1.0",
    "--set=vesicles.viscosity_contrast=4.2",
    "--set=numerics.points=32",
)
FOLLOWED = ("continue", *TREADING, "--parameter=vesicles.viscosity_contrast")


@pytest.fixture(scope="module")
def followed(ensemble, tmp_path_factory):
    """A store with a branch, and the document that was printed."""
    store = tmp_path_factory.mktemp("branches") / "store"
    result = ensemble(*FOLLOWED, f"--store={store}", "--json")
    assert result.returncode == 0, result.stderr
    return store, json.loads(result.stdout)


def test_a_branch_is_followed_through_its_fold_and_back(followed):
    _, document = followed
    (fold,) = document["folds"]
    assert document["crossings"] == []
    values = [point["parameter"] for point in document["branch"]]
    assert values[0] == values[-1] == 4.2
    assert max(values) <= fold["value"] == pytest.approx(4.2345, abs=5e-3)
    stable = [point["stable"] for point in document["branch"]]
    assert stable[0]
    assert not stable[-1]
    assert abs(fold["eigenvalues"][0][0]) < 1e-4
    first = document["branch"][0]
    assert first["outcome"] == "steady"
    assert (
        first["inclination_angle"] > fold["inclination_angle"] > document["branch"][-1]["inclination_angle"]
    )
    assert first["viscosity"]["total"] > 0


def test_a_steady_state_is_the_first_point_of_its_branch(ensemble, followed):
    store, document = followed
    result = ensemble("steady", *TREADING, f"--store={store}", "--json")
    assert result.returncode == 0
    answer = json.loads(result.stdout)
    first = document["branch"][0]
    assert answer["stable"] is first["stable"] is True
    assert answer["inclination_angle"] == pytest.approx(first["inclination_angle"], abs=1e-8)
    np.testing.assert_allclose(answer["eigenvalues"], first["eigenvalues"], atol=1e-6)
    with Store.existing(store) as opened:
        assert [summary.key for summary in opened.summaries()] == [answer["run_key"]]


def test_a_stored_branch_is_not_followed_again(ensemble, followed):
    store, document = followed
    result = ensemble(*FOLLOWED, f"--store={store}", "--json")
    again = json.loads(result.stdout)
    assert again["created"] == document["created"]


def test_a_stored_branch_is_shown_listed_checked_and_drawn(ensemble, followed, tmp_path):
    store, document = followed
    key, place = document["key"], f"--store={store}"
    assert json.loads(ensemble("query", "branches", place, "--json").stdout)[0]["folds"] == document["folds"]
    with Store.existing(store) as opened:
        for conditions, found in (
            (["flow.rate>0", f"parameter={document['parameter']}"], [key]),
            (["folds.value<0"], []),
            (["vesicles.reduced_area<0.95", "branch.0.stable=true"], [key]),
        ):
            answers = StoredBranches.all_stored(opened, Listing(tuple(conditions), "-created", 5), ["key"])
            assert [answers.columns[0].value(each) for each in answers.json_documents] == found
        with pytest.raises(StoreInputError, match=r"unknown field 'flow\.rat'"):
            StoredBranches.all_stored(opened, Listing(("flow.rat=1",)), [])
    assert "fold" in ensemble("show", key, place).stdout
    file = tmp_path / "diagram.svg"
    assert ensemble("show", key[:8], place, f"--output={file}").returncode == 0
    assert file.stat().st_size > 1000
    with Store.existing(store) as opened:
        assert opened.check() == []
    merged = ensemble("merge", str(store), f"--into={tmp_path / 'merged'}", "--json")
    assert json.loads(merged.stdout)["branches"] == 1
    with Store.existing(store) as source, Store.existing(tmp_path / "merged") as target:
        assert target.check() == []
        assert target.branches.summaries() == source.branches.summaries()
    archive = ZipStore(store / "branches" / key / "zarr.zip", mode="r")
    arrays = xarray.open_zarr(archive, consolidated=False).load()
    assert arrays["tangent_angle"].dims == ("parameter", "vesicle", "point")
    np.testing.assert_array_equal(
        arrays["parameter"].values, [point["parameter"] for point in document["branch"]]
    )


def test_a_damaged_branch_is_noticed(followed, tmp_path):
    store, document = followed
    copy = tmp_path / "copy"
    shutil.copytree(store, copy)
    with unpacked(copy / "branches" / document["key"]) as files:
        chunk = next(path for path in (files / "tangent_angle" / "c").rglob("*") if path.is_file())
        chunk.write_bytes(chunk.read_bytes()[:-1] + b"?")
    with Store.existing(copy) as opened:
        assert any(document["key"] in problem for problem in opened.check())
        opened.branches.read(document["key"])
        with pytest.raises(StoreError):
            opened.branches.read("0" * 32)


def test_a_damaged_branch_is_left_out_and_set_aside(followed, tmp_path):
    store, document = followed
    copy = shutil.copytree(store, tmp_path / "copy")
    (copy / "branches" / document["key"] / "zarr.zip").write_bytes(b"damaged")
    with Store.existing(copy) as opened:
        assert opened.branches.summaries() == []
    assert "branches" not in xarray.open_datatree(copy)
    (done,) = repair(copy)
    assert document["key"] in done
    assert (copy / "lost+found" / document["key"] / "zarr.zip").read_bytes() == b"damaged"
    with Store.existing(copy) as opened:
        assert opened.check() == []


def test_the_diagram_shows_stable_and_unstable_parts_up_to_the_fold(followed):
    store, document = followed
    with Store.existing(store) as opened:
        figure = bifurcation_diagram(opened.branches.summaries())
    upper, lower = figure.axes
    (fold,) = [line for line in upper.lines if line.get_gid() == "fold"]
    (stable,) = [line for line in upper.lines if line.get_gid() == "stable"]
    (unstable,) = [line for line in upper.lines if line.get_gid() == "unstable"]
    place = fold.get_xydata()[0]
    assert place[0] == document["folds"][0]["value"]
    np.testing.assert_array_equal(stable.get_xydata()[-1], place)
    np.testing.assert_array_equal(unstable.get_xydata()[0], place)
    growth = {line.get_gid(): line.get_ydata() for line in lower.lines}
    assert max(growth["stable"][:-1]) < 0 < min(growth["unstable"][1:])


REFUSED = {
    "a branch of a pair that revolves": (
        ["continue", "doublet-shear", "--parameter=flow.rate"],
        "flow.kind",
    ),
    "an unequal pair that revolves": (
        ["steady", "doublet-shear", "--set=vesicles.1.reduced_area=0.8"],
        "vesicles",
    ),
    "many vesicles": (["steady", "suspension-shear"], "vesicles"),
    "no number": (["continue", *TREADING, "--parameter=flow.kind"], "flow.kind"),
    "the same value": ([*FOLLOWED, "--to=4.2"], "to"),
    "a value that is not allowed": ([*FOLLOWED, "--to=-1"], "viscosity_contrast"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_refused_before_any_work(ensemble, tmp_path, case):
    arguments, field = REFUSED[case]
    result = ensemble(*arguments, "--store=store", cwd=tmp_path)
    assert result.returncode == 2
    assert field in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_does_not_rest_has_no_steady_state(ensemble):
    result = ensemble("steady", *TREADING, "--set=vesicles.viscosity_contrast=6", "--no-store", "--json")
    assert result.returncode == INCOMPLETE_STATUS
    assert "tumbling" in json.loads(result.stdout)["failure"]


def test_of_a_pair_that_revolves_the_stability_of_its_motion_is_told(ensemble, tmp_path):
    coarse = ("--set=numerics.points=32", "--set=adhesion.hamaker=1.0", f"--store={tmp_path / 'store'}")
    result = ensemble("steady", "doublet-shear", *coarse, "--json")
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert answer["stable"] is True
    assert answer["growth_factor"] == pytest.approx(
        np.exp(answer["growth_rate"] * answer["period"]), rel=1e-12
    )
    run = ensemble("run", "doublet-shear", *coarse, "--json")
    assert json.loads(run.stdout)["run_key"] == answer["run_key"]


def test_a_motion_that_has_not_settled_has_no_stability(ensemble):
    result = ensemble("steady", "doublet-shear", "--set=adhesion.hamaker=0.1", "--no-store", "--json")
    assert result.returncode == INCOMPLETE_STATUS
    assert "separated" in json.loads(result.stdout)["failure"]
