"""The command that measures adhesion."""

from __future__ import annotations

from typing import Annotated

import typer

from ensemble.cli.options import AsJson, Changes, Document, NoStore, StorePath
from ensemble.cli.printing import print_answer
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import refusing
from ensemble.mpi.world import launched_rank


def measure_adhesion(  # numpydoc ignore=PR01
    scene: Document = "doublet-trap",
    changes: Changes = [],  # noqa: B006  typer copies it
    error: Annotated[
        list[str],
        typer.Option(
            "--error",
            metavar="PATH=FRACTION",
            help="Relative standard error of an input, such as flow.rate=0.05.  Repeatable.",
        ),
    ] = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    no_store: NoStore = False,
    as_json: AsJson = False,
) -> None:
    """Find how strong an adhesion is, from the extension rate at which a fluid trap ends side by side.

    The scene is the pair in a trap, with flow.rate the critical rate that was measured as the rate rose
    slowly, and with its reduced area, adhesion distance and units.  The error of the answer is that of
    the inputs, propagated, and of the numerics.  The exit status is 4 if there is no answer.
    """
    from ensemble.config.documents import load_scene
    from ensemble.config.overrides import parse_override
    from ensemble.questions.adhesion_measurement import AdhesionMeasurement

    with refusing():
        errors = dict(map(parse_override, error))
        for path, value in errors.items():
            if not isinstance(value, int | float):
                raise ValueError(f"error: {path}={value!r} — must be a number")
        measurement = AdhesionMeasurement(load_scene(scene, changes), errors)
    if launched_rank() != 0:
        raise typer.Exit
    print_answer(measurement.answer(None if no_store else store), as_json)
