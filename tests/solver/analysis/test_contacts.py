"""Clusters are who touches whom, and runs of many vesicles record them; runs of two have nothing new."""

from __future__ import annotations

import numpy as np
import pytest

from solver.analysis.contacts import CONTACT, cluster_sizes, clusters, contacts
from solver.scene import Numerics, Output, PowerLaw, Scene, Shear, Vesicle
from solver.scene.arrangement import Lattice
from solver.simulation.simulate import simulate
from tests.solver.scenes import geometry_of, shear_pair

CIRCLE = Vesicle(reduced_area=1.0)


def circles(*centers: tuple[float, float]) -> Scene:
    vesicles = tuple(CIRCLE.model_copy(update={"center": center}) for center in centers)
    return Scene(horizon=1.0, vesicles=vesicles, numerics=Numerics(points=64))


def test_contacts_are_between_membranes_not_centers() -> None:
    geometry = geometry_of(circles((0, 0), (2.3, 0), (0, 2.5), (10, 0)))
    assert contacts(geometry, 0.2).tolist() == []
    assert contacts(geometry, 0.4).tolist() == [[0, 1]]
    assert contacts(geometry, 0.6).tolist() == [[0, 1], [0, 2]]


def test_clusters_are_the_connected_parts() -> None:
    geometry = geometry_of(circles((0, 0), (10, 0), (2.3, 0), (12.3, 0), (4.6, 0), (0, 9)))
    labels = clusters(geometry, 0.4)
    assert labels.tolist() == [0, 1, 0, 1, 0, 2]
    assert cluster_sizes(labels).tolist() == [3, 2, 1]


@pytest.fixture(scope="module")
def aggregating() -> Scene:
    """Four vesicles in a row, two by two in reach of each other, and one apart, at rest."""
    row = [CIRCLE.model_copy(update={"reduced_area": 0.95, "center": (x, 0.0)}) for x in (0, 2.5, 7, 9.5, 20)]
    return Scene(
        horizon=2.0,
        vesicles=tuple(row),
        adhesion=PowerLaw(hamaker=1.5, distance=0.4),
        numerics=Numerics(points=32, tolerance=1e-3),
    )


def test_a_run_of_many_records_clusters_and_each_vesicle(aggregating: Scene) -> None:
    run = simulate(aggregating)
    samples, vesicles = len(run.series["time"]), len(aggregating.vesicles)
    assert {name: values.shape for name, values in run.vesicle_series.items()} == {
        "vesicle_center": (samples, vesicles, 2),
        "vesicle_inclination_angle": (samples, vesicles),
        "vesicle_area_error": (samples, vesicles),
        "vesicle_cluster": (samples, vesicles),
    }
    np.testing.assert_array_equal(run.vesicle_series["vesicle_center"][-1], run.frames.center[-1])
    np.testing.assert_array_equal(
        np.abs(run.vesicle_series["vesicle_area_error"]).max(axis=1), run.series["area_error"]
    )
    labels = run.vesicle_series["vesicle_cluster"]
    np.testing.assert_array_equal(run.series["clusters"], labels.max(axis=1) + 1)
    assert labels[-1].tolist() == [0, 0, 1, 1, 2]
    assert run.series["largest_cluster"][-1] == 2
    assert run.series["gap"][-1] < CONTACT * 0.4


def test_what_a_scene_does_not_need_is_not_measured(aggregating: Scene, monkeypatch) -> None:
    def never(*arguments: object) -> None:
        raise AssertionError("clusters were looked for")

    monkeypatch.setattr("solver.analysis.diagnostics.clusters", never)
    alone = simulate(aggregating.model_copy(update={"adhesion": None, "horizon": 0.5}))
    assert "vesicle_cluster" not in alone.vesicle_series
    assert not {"clusters", "largest_cluster"} & alone.series.keys()
    pair = simulate(shear_pair(1.5, numerics=Numerics(points=32), horizon=1.0))
    assert pair.vesicle_series == {}
    assert not {"clusters", "largest_cluster"} & pair.series.keys()


def test_a_suspension_has_the_viscosity_of_the_second_half_of_its_run() -> None:
    scene = Scene(
        horizon=4.0,
        arrangement=Lattice(columns=3, rows=1, spacing=(6.0, 6.0)),
        flow=Shear(rate=1.0),
        numerics=Numerics(points=32, tolerance=1e-4),
        output=Output(interval=0.05),
    )
    run = simulate(scene)
    late = run.series["time"] >= 2.0
    mean = np.trapezoid(run.series["viscosity_bending_tension"][late], run.series["time"][late]) / 2.0
    assert run.viscosity is not None
    assert run.viscosity.total == pytest.approx(mean, rel=1e-3)
    assert run.viscosity.adhesion is None
