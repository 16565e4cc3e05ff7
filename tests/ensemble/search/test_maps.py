"""Maps are exact wherever they have looked, whatever the order of answers, and are kept as they are."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, CompletedProcess, Popen
from typing import Any

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from zarr.storage import ZipStore

from ensemble.config.documents import load
from ensemble.config.outcome_map import OutcomeMap
from ensemble.errors import EnsembleError
from ensemble.figures import map_diagram
from ensemble.questions.map_question import MapQuestion
from ensemble.search.map_planner import MapPlanner, MapRun
from ensemble.search.map_record import MapRecord
from ensemble.search.map_refinement import Cell, MapRefinement, beside_changes
from ensemble.search.task_queue import RunAnswer
from ensemble.store import Store
from ensemble.store.merge import merge
from solver.analysis.run import Configuration, Outcome
from solver.analysis.run_labels import LABELS, add_label, label_of
from solver.scene import Scene, Shear
from tests.conftest import ENSEMBLE
from tests.ensemble.runs import shear_run

N = 50  # cells along each axis, hence a resolution of two percent
Regions = Callable[[float, float], int]
REGIONS: dict[str, Regions] = {
    "a line": lambda x, y: int(y > 0.1 + 0.5 * x),
    "a steep line": lambda x, y: int(y > 0.1 + 0.9 * x),
    "a level line": lambda x, y: int(y > 0.41),
    "a disk": lambda x, y: int((x - 0.5) ** 2 + (y - 0.5) ** 2 < 0.1),
    "three regions": lambda x, y: 2 if x > 0.6 + 0.2 * y else int(y > 0.1 + 0.5 * x),
    "a small disk": lambda x, y: int((x - 0.33) ** 2 + (y - 0.4) ** 2 < 0.012),
}


def label_at(regions: Regions, cell: Cell) -> int:
    return regions((cell[0] + 0.5) / N, (cell[1] + 0.5) / N)


def refined(regions: Regions, choose: Callable[[list[Cell]], Cell] = min) -> MapRefinement:
    refinement = MapRefinement((N, N), 6)
    while not refinement.done:
        cell = choose(sorted(refinement.wave))
        refinement.tell(cell, label_at(regions, cell))
    return refinement


@pytest.mark.parametrize("regions", REGIONS.values(), ids=REGIONS.keys())
def test_a_map_is_exact_in_few_runs(regions: Regions) -> None:
    refinement = refined(regions)
    exact = np.array([[label_at(regions, (i, j)) for j in range(N)] for i in range(N)])
    np.testing.assert_array_equal(refinement.labels, exact)
    at_boundary = beside_changes(exact)
    assert refinement.made[at_boundary].all(), "both sides of every change are run"
    assert refinement.made.sum() <= 2.5 * at_boundary.sum()
    squares = (exact[1:, 1:] != exact[:-1, :-1]) | (exact[1:, :-1] != exact[:-1, 1:])
    assert refinement.made.sum() <= 4 * squares.sum(), "also if only one cell is counted for two sides"


@settings(deadline=None, max_examples=10)
@given(data=st.data())
def test_a_map_does_not_depend_on_the_order_of_answers(data: st.DataObject) -> None:
    random = data.draw(st.randoms(use_true_random=False))
    # Labels without any order, so that what is inferred is often wrong.
    noise = np.random.default_rng(3).integers(0, 2, (N, N)) * (np.add.outer(range(N), range(N)) % 17 == 0)

    def regions(x: float, y: float) -> int:
        return int(noise[int(x * N), int(y * N)])

    one, other = refined(regions), refined(regions, random.choice)
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_array_equal(one.made, other.made)


CHANGES = {"axes.0.resolution": 0.125, "axes.1.spacing": "geometric", "scene.numerics.points": 32}
COARSE = load(OutcomeMap, "shear-hamaker-map", CHANGES)


def outcome(scene: Scene) -> Outcome:
    assert isinstance(scene.flow, Shear)
    assert scene.adhesion is not None
    bound = scene.adhesion.hamaker > 0.1 + 0.571 * scene.flow.rate
    return Outcome.BOUND if bound else Outcome.SEPARATED


def answer(task: MapRun) -> RunAnswer:
    return RunAnswer(outcome(task.scene))


def drawn(known: dict[str, RunAnswer], workers: int = 1) -> tuple[MapRecord, list[MapRun]]:
    """Draw the coarse map, and return it with the runs made for it."""
    planner, made, out = MapPlanner(COARSE, known.get), list[MapRun](), list[MapRun]()
    while not planner.done:
        while len(out) < workers and (task := planner.next_task()) is not None:
            out.append(task)
        assert planner.runs_left >= len(out)
        made.append(out.pop())
        planner.answer(made[-1], answer(made[-1]))
    return planner.record(), made


def test_what_is_known_is_never_run_again() -> None:
    record, made = drawn({}, workers=3)
    assert record.labels == ["bound", "separated"]
    assert {each.run for each in record.runs} == {task.key for task in made}
    known = {task.key: answer(task) for task in made}
    half = dict(list(known.items())[::2])
    again, added = drawn(half)
    assert {task.key for task in added} == known.keys() - half.keys()
    assert again.model_copy(update={"updated": record.updated}) == record
    assert drawn(known)[1] == []
    for each in record.run_documents():
        low, high = each["parameters"]["flow.rate"], each["parameters"]["adhesion.hamaker"]
        assert each["label"] == ("bound" if high > 0.1 + 0.571 * low else "separated")


def test_a_map_is_kept_and_drawn_as_it_is(tmp_path: Path) -> None:
    record, _ = drawn({})
    with Store.open(tmp_path / "store") as store, Store.open(tmp_path / "other") as other:
        store.save_map(record)
        store.save_map(record)
        assert store.maps() == [record]
        assert store.check() == []
        assert merge(store, other).maps == 1
        assert merge(store, other).maps == 0
        assert other.maps() == [record]
    archive = ZipStore(tmp_path / "store" / "maps" / record.key / "zarr.zip", mode="r")
    data = xarray.open_zarr(archive, consolidated=False)
    words = data["label"].attrs["flag_meanings"].split()
    here = {"flow.rate": 0.2, "adhesion.hamaker": 1.5}
    assert words[int(data["label"].sel(here, method="nearest"))] == "bound"
    assert int(data["made"].sum()) == len(record.runs)
    tree = xarray.open_datatree(tmp_path / "store")
    assert tree[f"maps/{record.key}"]["label"].sel(here, method="nearest") == "bound"
    (axes,) = map_diagram(record).axes
    (regions,) = (each for each in axes.collections if each.get_gid() == "regions")
    np.testing.assert_array_equal(np.reshape(regions.get_array(), (10, 8)), record.numbers.T)
    assert axes.get_yscale() == "log"


def test_the_command_draws_from_runs_that_the_store_has(
    ensemble: Callable[..., CompletedProcess[str]], tmp_path: Path
) -> None:
    """Takes 4 s: three processes."""
    record, made = drawn({})
    store, figure = tmp_path / "store", tmp_path / "map.png"
    with Store.open(store) as opened:
        for task in made:
            opened.save(shear_run(task.scene, outcome(task.scene)))
    changes = [f"--set={path}={value}" for path, value in CHANGES.items()]
    answered = ensemble("map", "shear-hamaker-map", *changes, "--store", str(store), "--json")
    assert answered.returncode == 0, answered.stderr
    document = json.loads(answered.stdout)
    assert (document["made"], document["runs"]) == (0, len(made))
    assert document["cells"] == 80
    bound = sum(column.count(0) for column in record.cells) / 80
    assert MapQuestion.summary(document) == f"bound {bound:.1%}, separated {1 - bound:.1%}"
    shown = ensemble("show", "shear-hamaker-map", "--store", str(store), "--output", str(figure))
    assert shown.returncode == 0, shown.stderr
    assert figure.stat().st_size > 0
    listed = ensemble("query", "maps", "--store", str(store), "--json")
    assert [each["key"] for each in json.loads(listed.stdout)] == [record.key]


def test_where_there_is_no_scene_nothing_is_run() -> None:
    one_passes_the_other = {"axes.0.parameter": "vesicles.0.center.0", "axes.0.limits": [-6.0, 6.0]}
    passing = load(
        OutcomeMap, "shear-hamaker-map", one_passes_the_other | {"scene.vesicles.1.center": [0.0, 0.0]}
    )
    planner = MapPlanner(passing, lambda _: None)
    while (task := planner.next_task()) is not None:
        planner.answer(task, answer(task))
    assert planner.done
    record = planner.record()
    assert record.labels == ["bound", "no-scene", "separated"]
    overlapping = np.abs(passing.axes[0].values) < 1.5
    np.testing.assert_array_equal((record.numbers == 1).all(axis=1), overlapping)
    np.testing.assert_array_equal((record.numbers == 1).any(axis=1), overlapping)
    assert not any(overlapping[each.cell[0]] for each in record.runs)
    assert {each["label"] for each in record.run_documents()} == {"bound", "separated"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"axes.0.parameter": "adhesion.hamaker"},
            r"axes\.1\.parameter: must differ from axes\.0\.parameter",
        ),
        ({"axes.0.parameter": "flow.speed"}, r"axes\.0\.parameter: 'flow\.speed' — must be the dotted path"),
        ({"axes.0.limits": [1.0, 0.5]}, r"axes\.0: limits: the first must be less than the second"),
        ({"axes.0.limits": [0.0, 0.5], "axes.0.spacing": "geometric"}, "must be above 0"),
        (
            {"axes.1.resolution": 0.001},
            r"axes\.1\.resolution: 0\.001 — input should be greater",
        ),
        ({"label": "color"}, "label: 'color' — input should be 'outcome' or 'configuration'"),
        ({"axes.0.limits": [-1.0, 0.5]}, r"axes: flow\.rate=-0\.925, adhesion\.hamaker=0\.17 — flow\.rate: "),
        ({"axes.0.limits": [0.5, 0.500000000001]}, r"axes\.0: limits: must be farther apart"),
        ({"axes": 5}, "axes: 5 — must be a list$"),
    ],
)
def test_what_is_no_map_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load(OutcomeMap, "shear-hamaker-map", change)


def test_cells_may_be_told_apart_by_another_label() -> None:
    assert label_of("configuration", RunAnswer(Outcome.BOUND, False, Configuration.ROLLING)) == "rolling"
    assert label_of("configuration", RunAnswer(Outcome.SEPARATED)) == "separated"
    add_label("motion", lambda run: f"sensitive-{run.sensitive}")
    try:
        assert label_of("motion", RunAnswer(Outcome.BOUND)) == "sensitive-False"
        assert load(OutcomeMap, "shear-hamaker-map", {"label": "motion"}).label == "motion"
    finally:
        LABELS.remove("motion")


@pytest.mark.long
def test_a_map_that_is_killed_goes_on_to_the_same_map(
    launcher: Any, ensemble: Callable[..., CompletedProcess[str]], tmp_path: Path
) -> None:
    """Takes about 40 s: two maps of 14 runs."""
    changes = {"scene.numerics.points": 32, "scene.numerics.tolerance": 1e-3, "axes.resolution": 0.25}
    options = [f"--set={path}={value}" for path, value in changes.items()]
    arguments = ["map", "shear-hamaker-map", *options, "--json", "--store"]
    whole = launcher.run(2, [*ENSEMBLE, *arguments, str(tmp_path / "whole")])
    assert whole.returncode == 0, whole.stderr
    with Popen([*ENSEMBLE, *arguments, str(tmp_path / "killed")], stdout=DEVNULL, stderr=DEVNULL) as process:
        wait_for_runs(tmp_path / "killed", 3)
        process.kill()
    resumed = ensemble(*arguments, str(tmp_path / "killed"))
    assert resumed.returncode == 0, resumed.stderr
    first, second = json.loads(whole.stdout), json.loads(resumed.stdout)
    assert 0 < second["made"] <= second["runs"] - 3
    for name in ("key", "cells", "shares", "boundary_cells", "runs"):
        assert first[name] == second[name]
    with Store.existing(tmp_path / "whole") as one, Store.existing(tmp_path / "killed") as other:
        assert one.maps()[0].cells == other.maps()[0].cells


def wait_for_runs(path: Path, count: int) -> None:
    for _ in range(6000):
        with suppress(EnsembleError), Store.existing(path) as store:
            if store.count_runs() >= count:
                return
        time.sleep(0.05)
    raise AssertionError("no runs are made")
