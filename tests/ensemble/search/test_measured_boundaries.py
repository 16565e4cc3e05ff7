"""Boundaries with units are those without, and show their values in both."""

from __future__ import annotations

from ensemble.config.documents import load_study
from ensemble.display.result_tables import boundary_table
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.timestamp import now
from solver.scene import Units

UNITS = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
POINT = BoundaryPoint(
    parameters={"flow.rate": 0.5},
    bracket=(0.25, 1.0),
    outcomes=("separated", "bound"),
    status="converged",
    certified=False,
    runs=[],
)


def boundary() -> Boundary:
    study = load_study("critical-hamaker", ["sweep.values=[0.5]"])
    return Boundary(
        study_key=study.key,
        study=study.model_dump(mode="json"),
        name=study.name,
        points=[POINT],
        updated=now(),
    )


def test_the_points_have_their_values_in_units() -> None:
    (document,) = boundary().in_units(UNITS).point_documents()
    assert document["in_units"] == {
        "flow.rate": {"value": 0.05, "unit": "1/s"},
        "critical_value": {"value": 50.0, "unit": "µPa"},
        "bracket": {"value": [25.0, 100.0], "unit": "µPa"},
    }
    assert boundary().point_documents() == [POINT.model_dump(mode="json")]


def test_the_table_has_columns_in_units() -> None:
    table = boundary_table(boundary().in_units(UNITS))
    cells = {str(column.header): list(column.cells) for column in table.columns}
    assert cells["flow.rate (1/s)"] == ["0.05"]
    assert cells["critical value (µPa)"] == ["50"]
    assert cells["bracket (µPa)"] == ["25 – 100"]
    assert "bracket (µPa)" not in {str(column.header) for column in boundary_table(boundary()).columns}
