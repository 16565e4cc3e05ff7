"""The scaling report: a model that is recovered from its own times, and measurements on real ranks."""

from __future__ import annotations

import importlib.util
import json
import math
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import ensemble
import solver
from ensemble.config.documents import load_scene
from ensemble.figures import save
from ensemble.mpi.scaling_model import LEAST_EFFICIENCY, MEASURED, ScalingModel, recommended_ranks
from ensemble.report.scaling.counting_ranks import CountingRanks
from ensemble.report.scaling.scaling_document import (
    CollectiveTime,
    EvaluationCost,
    Scaling,
    SharedEvaluation,
)
from ensemble.report.scaling.scaling_figures import scaling_figures
from ensemble.report.scaling.scaling_fit import (
    fit_model,
    recommend_ranks,
)
from ensemble.report.scaling.scaling_plan import FULL, POINTS, QUICK, ScalingPlan, suspension
from ensemble.report.scaling.scaling_text import scaling_conclusions, scaling_text
from ensemble.report.scaling.simulated_groups import FEWEST_RUNS, MeasuredCosts, simulate_groups
from ensemble.report.scaling.time_shares import _PART_OF_FOLDER, _PART_OF_MODULE, PARTS, time_shares
from ensemble.store import Store
from solver.parallel import SERIAL
from tests.conftest import Launcher
from tests.ensemble.runs import shear_run, shear_scene

KNOWN = ScalingModel(
    level=3e-7,
    point=5e-6,
    repeated=4e-6,
    fixed=2e-4,
    gathers=6.0,
    bytes_a_point=16.0,
    latency=1e-5,
    bandwidth=1e9,
)


def test_one_rank_exchanges_nothing_and_is_efficient():
    for points in (64, 10_000):
        assert KNOWN.collectives(points, 1) == 0
        assert KNOWN.efficiency(points, 1) == 1
        assert KNOWN.seconds(points, 1) == pytest.approx(
            3e-7 * points * math.log2(points) + 9e-6 * points + 2e-4
        )


def test_an_evaluation_takes_at_least_what_every_rank_repeats_and_exchanges():
    seconds = [KNOWN.seconds(4096, ranks) for ranks in (1, 2, 4, 8)]
    assert seconds == sorted(seconds, reverse=True)
    floor = 4e-6 * 4096 + 2e-4 + 6 * (1e-5 * 20 + 16 * 4096 / 1e9)
    assert KNOWN.seconds(4096, 2**20) == pytest.approx(floor, rel=1e-3)


def evaluation(vesicles: int, ranks: int, **fields: float) -> SharedEvaluation:
    gathered = KNOWN.gathers * KNOWN.bytes_a_point * POINTS * vesicles
    values = {
        "seconds": KNOWN.seconds(POINTS * vesicles, ranks),
        "efficiency": KNOWN.efficiency(POINTS * vesicles, ranks),
        "gathers": KNOWN.gathers,
        "gathered_bytes": gathered,
        "difference": 0.0,
        **dict.fromkeys(PARTS, 0.25),
    }
    return SharedEvaluation(vesicles=vesicles, ranks=ranks, **values | fields)


COSTS = [
    EvaluationCost(
        vesicles=vesicles,
        seconds=KNOWN.seconds(POINTS * vesicles, 1),
        sums=8.0,
        peak_memory_bytes=1,
    )
    for vesicles in (8, 16, 32, 64, 128)
]


def test_a_model_is_recovered_from_its_own_times():
    collectives = [
        CollectiveTime(
            ranks=ranks,
            gathered_bytes=size,
            seconds=1e-5 * math.ceil(math.log2(ranks)) + size * (ranks - 1) / ranks / 1e9,
        )
        for ranks in (2, 4)
        for size in (16, 1024, 10**6)
    ]
    model = fit_model(COSTS, [evaluation(16, 2), evaluation(64, 2)], collectives)
    for name, value in KNOWN.model_dump().items():
        assert getattr(model, name) == pytest.approx(value, rel=1e-6), name


def test_the_recommendation_is_the_last_efficient_number_of_ranks():
    for found in recommend_ranks(KNOWN):
        points = POINTS * found.vesicles
        assert found.ranks == 1 or KNOWN.efficiency(points, found.ranks) >= LEAST_EFFICIENCY
        assert found.ranks == 10_000 or KNOWN.efficiency(points, found.ranks + 1) < LEAST_EFFICIENCY
    pair = load_scene("doublet-shear")
    assert recommended_ranks(pair, 64) == MEASURED.recommended_ranks(64, 64)  # its image is not computed


def test_what_is_gathered_is_counted():
    counted = CountingRanks(SERIAL)
    shares = counted.divide(5)
    assert shares.own == slice(0, 5)
    part = np.arange(10.0).reshape(5, 2)
    np.testing.assert_array_equal(shares.gather(part), part)
    shares.gather(part)
    assert (counted.rank, counted.size, counted.gathers, counted.gathered_bytes) == (0, 1, 2, 160)
    counted.reset()
    assert (counted.gathers, counted.seconds) == (0, 0.0)


def test_every_module_and_folder_of_a_part_exists() -> None:
    names = {
        path.stem for package in (solver, ensemble) for path in Path(package.__file__).parent.rglob("*.py")
    }
    assert names >= _PART_OF_MODULE.keys()
    for folder in _PART_OF_FOLDER:
        assert importlib.util.find_spec(folder if folder == "scipy" else f"solver.{folder}")


def test_the_parts_of_an_evaluation_are_its_whole_time():
    shares = time_shares(lambda: CountingRanks(SERIAL).divide(3).gather(np.zeros((3, 2))))
    assert shares.keys() == set(PARTS)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["collectives"] > 0


@pytest.mark.parametrize("plan", [QUICK, FULL])
def test_plans_reach_from_a_pair_to_many(plan):
    assert plan.shared[0] == plan.single[0] == 2
    assert list(plan.single) == sorted(plan.single)
    assert suspension(2).vesicles == load_scene("doublet-shear").vesicles
    assert len(suspension(16).vesicles) == 16


FREE = MeasuredCosts(message=0.0, commit=0.0, commit_work=0.0, further_commit=0.0)


def test_one_simulated_group_takes_the_time_of_its_runs(tmp_path: Path) -> None:
    use = simulate_groups(1, [10.0], FREE, tmp_path)
    assert use.points == 1
    assert use.runs >= 2
    assert use.wall_seconds == pytest.approx(10.0 * use.runs, rel=0.1)
    assert use.busy > 0.9
    assert 0 < use.dispatcher_share < 0.1
    assert list(tmp_path.iterdir()) == []


def test_slow_commits_take_time_but_little_work(tmp_path: Path) -> None:
    slow = MeasuredCosts(message=0.0, commit=10.0, commit_work=1.0, further_commit=1.0)
    use = simulate_groups(1, [10.0], slow, tmp_path)
    assert use.wall_seconds == pytest.approx(20.0 * use.runs, rel=0.1)
    assert use.dispatcher_seconds_a_run == pytest.approx(1.0, rel=0.2)


def test_costs_are_measured_with_stored_runs(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store") as store:
        for number in range(FEWEST_RUNS):
            store.save(shear_run(shear_scene(rate=0.5 + 0.01 * number)))
        costs = MeasuredCosts.here(store, tmp_path)
    assert 0 < costs.commit_work <= costs.commit
    assert costs.message > 0
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


MEASURING = """
import json, sys
from pathlib import Path
from ensemble.mpi.world import abort_guard, world
from ensemble.report.scaling.make_scaling import measure_scaling
from ensemble.report.scaling.scaling_plan import ScalingPlan
communicator = world()
with abort_guard(communicator):
    plan = ScalingPlan(**json.loads(sys.argv[2]))
    document = measure_scaling(communicator, plan, lambda line: None)
    assert (document is None) == (communicator.Get_rank() > 0)
    if document is not None:
        Path(sys.argv[1]).write_text(document.model_dump_json())
"""


def measured(launcher: Launcher, ranks: int, plan: ScalingPlan, directory: Path) -> Scaling:
    """The report that real ranks measure.

    There may be more ranks than the machine has cores, and the times those of a crowd.
    """
    file = directory / "scaling.json"
    result = launcher.run(ranks, [sys.executable, "-c", MEASURING, str(file), json.dumps(asdict(plan))])
    assert result.returncode == 0, result.stderr
    return Scaling.model_validate_json(file.read_text())


def assert_drawn_and_written(report: Scaling, directory: Path) -> None:
    """Figures and text show what the report holds."""
    figures = scaling_figures(report)
    assert "`ensemble bisect` makes them" in scaling_text(report, [])
    use = simulate_groups(4, [10.0], FREE, directory)
    report = report.model_copy(update={"groups": [use]})
    assert f"4 groups with runs of 10 s, simulated: {use.busy:.0%} busy" in scaling_text(report, [])
    assert figures.keys() == {"efficiency", "parts", "cost"}
    for name, figure in figures.items():
        save(figure, directory / f"{name}.png")
        assert (directory / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    text = scaling_text(report, ["cost.png"])
    assert "![cost.png](cost.png)" in text
    assert text.split("\n\n")[1].splitlines() == [f"- {each}" for each in scaling_conclusions(report)]
    assert "## Cost against the number of vesicles" in text
    for point in report.evaluations:
        assert f"{point.seconds:.4g}" in text


def test_an_evaluation_is_measured_on_a_single_rank(launcher: Launcher, tmp_path: Path) -> None:
    report = measured(launcher, 1, ScalingPlan(shared=(8,), single=(8, 10), weak=8, repeats=1), tmp_path)
    (point,) = report.evaluations
    assert (point.vesicles, point.ranks, point.difference) == (8, 1, 0.0)
    assert point.seconds > 0
    assert point.predicted is not None
    assert point.kernels > point.collectives
    assert point.kernels + point.collectives + point.solves + point.other == pytest.approx(1.0)
    assert report.collectives == []
    assert all(cost.sums > 1 for cost in report.costs)
    assert_drawn_and_written(report, tmp_path)


@pytest.mark.long
def test_evaluations_are_measured_on_several_ranks(launcher: Launcher, tmp_path: Path) -> None:
    report = measured(launcher, 3, ScalingPlan(shared=(2, 8), single=(2, 8, 12), weak=8, repeats=1), tmp_path)
    assert [(point.vesicles, point.ranks) for point in report.evaluations] == [
        (vesicles, ranks) for vesicles in (2, 8) for ranks in (1, 2, 3)
    ]
    for point in report.evaluations:
        assert point.difference < 1e-9
        assert point.seconds > 0
        assert point.gathers > 0
        assert point.kernels + point.collectives + point.solves + point.other == pytest.approx(1.0)
        assert (point.predicted is None) == (point.vesicles == 2)
    assert [(point.vesicles, point.ranks) for point in report.weak] == [(8, 1), (16, 2), (24, 3)]
    assert {point.ranks for point in report.collectives} == {2, 3}
    assert [cost.vesicles for cost in report.costs] == [2, 8, 12]
    memory = [cost.peak_memory_bytes for cost in report.costs]
    assert memory == sorted(memory)
    assert all(cost.sums > 1 for cost in report.costs[1:])
    assert_drawn_and_written(report, tmp_path)
