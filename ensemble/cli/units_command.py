"""The command that converts the units of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ensemble.cli.options import AsJson, Changes, Document
from ensemble.cli.printing import print_json, print_table
from ensemble.errors import refusing

if TYPE_CHECKING:
    from ensemble.config.measured import Measured
    from solver.scene import Scene


def units(  # numpydoc ignore=PR01
    document: Document,
    changes: Changes = [],  # noqa: B006  typer copies it
    as_json: AsJson = False,
) -> None:
    """Print what the units of a scene or of a study's scene are, and its numbers in these.

    A scene without the table units gets it by --set units.radius='10 um' --set
    units.bending_modulus='1e-19 J' --set units.viscosity='1 mPa*s'; that of a study by scene.units.radius, ….
    """
    from rich.table import Table

    from ensemble.config.documents import read_document
    from ensemble.config.overrides import parse_override
    from ensemble.display.result_tables import list_cell
    from ensemble.questions import kind_of

    with refusing():
        kind = kind_of(read_document(document))
        rows = _rows(kind.load(document, dict(map(parse_override, changes))).scene)
    if as_json:
        print_json(rows)
        return
    table = Table("quantity", "in units of the scene", "with its unit")
    for row in rows:
        table.add_row(row["name"], list_cell(row["in_scene"]), f"{list_cell(row['value'])} {row['unit']}")
    print_table(table)


def _rows(scene: Scene) -> list[dict[str, Any]]:
    """Return one unit of each dimension, then the numbers of the scene, then what H means."""
    from ensemble.config.dotted_paths import locations, value_at
    from ensemble.config.measured import Measured, measured_fields, units_of
    from solver.dimensions import ADHESION_ENERGY, LENGTH

    units = scene.units
    if units is None:
        raise ValueError(
            "units — the scene has no such table: its radius, bending_modulus and viscosity are not known"
        )
    rows = [_row(each.name, each.unit, each.one) for each in units_of(units)]
    document = scene.model_dump(mode="json", exclude_none=True)
    for path, measured in measured_fields(scene, document, units).items():
        (location,) = locations(document, path)
        rows.append(_row(path, value_at(document, location), measured))
    if scene.adhesion is not None:
        flat = scene.adhesion.flat_membranes
        energy = scene.adhesion.hamaker * flat.energy
        rows += [
            _row("adhesion energy of flat membranes", energy, Measured.of(energy, ADHESION_ENERGY, units)),
            _row("their distance", flat.distance, Measured.of(flat.distance, LENGTH, units)),
        ]
    return rows


def _row(name: str, in_scene: Any, measured: Measured) -> dict[str, Any]:
    return {"name": name, "in_scene": in_scene} | measured._asdict()
