"""Critical values read from a boundary over two parameters, as arrays, and drawn."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import xarray
from zarr.storage import ZipStore

from ensemble.config.documents import load_study
from ensemble.errors import BadInput
from ensemble.figures import surface_diagram
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.boundary_reading import ReadingMethod, critical_value_at
from ensemble.search.known_brackets import Place
from ensemble.search.line import line_through
from ensemble.store import Store
from ensemble.store.boundary_arrays import boundary_dataset
from ensemble.store.merge import merge

RATES, AREAS = (0.25, 0.5, 1.0, 1.5), (0.7, 0.8, 0.95)
RATE, AREA = "flow.rate", "vesicles.reduced_area"
STUDY = load_study(
    "critical-hamaker-surface", [f"sweep.0.values={list(RATES)}", f"sweep.1.values={list(AREAS)}"]
)
WIDTH = 1.005


def surface(at: Place) -> float:
    """A critical value that is a parabola along each parameter."""
    rate, area = at
    return (0.1 + 0.5 * rate + 0.05 * rate**2) * (2.0 - area**2)


def point(at: Place, status: str = "converged") -> BoundaryPoint:
    known = status == "converged"
    return BoundaryPoint(
        parameters=dict(zip(STUDY.swept, at, strict=True)),
        bracket=(surface(at) / WIDTH, surface(at) * WIDTH) if known else (0.1, None),
        outcomes=("separated", "bound" if known else None),
        status=status,
        certified=False,
        runs=["a", "b"],
    )


def boundary(*without: Place) -> Boundary:
    return Boundary(
        study_key=STUDY.key,
        study=STUDY.model_dump(mode="json"),
        name=STUDY.name,
        points=[point(at, "searching" if at in without else "converged") for at in STUDY.places],
        updated=datetime(2026, 1, 1, tzinfo=UTC),
    )


@pytest.mark.parametrize("rate", [0.25, 0.3, 0.75, 1.45])
@pytest.mark.parametrize("area", [0.7, 0.74, 0.93])
def test_the_uncertainty_contains_the_exact_value_and_not_much_more(rate: float, area: float) -> None:
    read = critical_value_at(boundary(), {RATE: rate, AREA: area}, ReadingMethod.INTERPOLATED)
    low, high = read.uncertainty
    assert low <= surface((rate, area)) <= high
    assert low < read.critical_value < high
    # The bends along both parameters, and the brackets of one percent.
    assert high - low < 0.12 * read.critical_value
    assert len(read.points) == (1 if rate == 0.25 else 2) * (1 if area == 0.7 else 2)


def test_a_hole_is_bridged_and_else_refused() -> None:
    here = {RATE: 0.4, AREA: 0.75}
    bridged = critical_value_at(boundary((0.5, 0.8)), here, ReadingMethod.INTERPOLATED)
    assert {each[AREA] for each in bridged.points if each[RATE] == 0.5} == {0.7, 0.95}
    with pytest.raises(BadInput, match="not all points around"):
        critical_value_at(boundary((0.25, 0.8), (0.25, 0.95)), here, ReadingMethod.INTERPOLATED)
    with pytest.raises(BadInput, match=r"reduced_area: 0.6 — must lie within \[0.7, 0.95\]"):
        critical_value_at(boundary(), here | {AREA: 0.6}, ReadingMethod.INTERPOLATED)
    with pytest.raises(BadInput, match=r"flow\.rate and of vesicles\.reduced_area"):
        critical_value_at(boundary(), {RATE: 0.5}, ReadingMethod.INTERPOLATED)
    nearest = critical_value_at(boundary((0.5, 0.8)), {RATE: 0.52, AREA: 0.8}, ReadingMethod.NEAREST)
    assert nearest.parameters == {RATE: 0.25, AREA: 0.8}


def test_a_stored_boundary_is_a_data_set_over_both_parameters(tmp_path: Path) -> None:
    traced, other = boundary((0.5, 0.8)), tmp_path / "other"
    with Store.open(tmp_path / "store") as store, Store.open(other) as target:
        store.save_boundary(traced)
        store.save_boundary_arrays(boundary())
        store.save_boundary_arrays(traced)
        assert store.check() == []
        merge(store, target)
    archive = ZipStore(other / "boundaries" / STUDY.key / "zarr.zip", mode="r")
    stored, data = xarray.open_zarr(archive, consolidated=False), boundary_dataset(traced)
    assert Boundary.model_validate(stored.attrs) == traced
    for at in STUDY.places:
        here = dict(zip(STUDY.swept, at, strict=True))
        known = at != (0.5, 0.8)
        for each in (stored, data):
            expected = surface(at) if known else np.nan
            np.testing.assert_allclose(each["critical_value"].sel(here), expected, rtol=1e-12)
        assert data["status"].sel(here) == ("converged" if known else "searching")
        assert data["outcome"].sel(here | {"side": "high"}) == ("bound" if known else "")
    assert stored["flow.rate"].attrs["units"] == "mu^-1 R^-3 kappa"
    damaged = other / "boundaries" / STUDY.key / "zarr.zip"
    damaged.write_bytes(damaged.read_bytes()[:500])
    with Store.existing(other) as target:
        assert "boundary" in " ".join(target.check())


def test_a_surface_is_drawn_as_curves_and_as_a_filled_map() -> None:
    curves, filled, _ = surface_diagram(boundary((0.5, 0.8))).axes
    drawn = [line for line in curves.get_lines() if line.get_gid() == "curve"]
    for area, line in zip(AREAS, drawn, strict=True):
        rates = [rate for rate in RATES if (rate, area) != (0.5, 0.8)]
        np.testing.assert_allclose(line.get_xdata(), rates)
        np.testing.assert_allclose(line.get_ydata(), [surface((rate, area)) for rate in rates])
    (hole,) = (line for line in filled.get_lines() if line.get_gid() == "not converged")
    assert (hole.get_xdata(), hole.get_ydata()) == ([0.5], [0.8])
    assert line_through(boundary()) is None
