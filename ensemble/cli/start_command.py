"""The command that writes a scene which starts from given shapes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ensemble.cli.options import Changes, StorePath, preset_names_for_completion
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import refusing

if TYPE_CHECKING:
    from solver.scene import Scene


def start_from(  # numpydoc ignore=PR01
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN|FILE…",
            help="Key of a stored run or its beginning; or files of points, one for each vesicle.",
            show_default=False,
        ),
    ],
    document: Annotated[
        str | None,
        typer.Option(
            "--scene",
            metavar="DOCUMENT",
            help="Preset or TOML file of the scene that gets the shapes; left out, that of the run.",
            autocompletion=preset_names_for_completion,
            show_default=False,
        ),
    ] = None,
    time: Annotated[
        float | None,
        typer.Option(help="Of the run; left out, its end.  The recorded state nearest to it is taken."),
    ] = None,
    turn: Annotated[
        str, typer.Option(metavar="ANGLE", help="Counterclockwise, radians or such as '90 deg'.")
    ] = "0",
    shift: Annotated[
        tuple[float, float], typer.Option(metavar="X Y", help="After the turn, about the mean of centers.")
    ] = (0.0, 0.0),
    unit: Annotated[
        str | None,
        typer.Option(
            metavar="UNIT",
            help="Of the points in files, such as um, for a scene with the table units.",
            show_default=False,
        ),
    ] = None,
    changes: Changes = [],  # noqa: B006  typer copies it
    store: StorePath = DEFAULT_STORE,
) -> None:
    """Print a scene that starts from a stored run or from files of points, as a TOML document.

    The shapes are in it as numbers, so that it needs neither the store nor the files any more.
    """
    import tomli_w

    from ensemble.config.given_start import turned_and_shifted
    from ensemble.config.overrides import override, parse_override
    from ensemble.config.validation import validated
    from solver.scene import Scene

    with refusing():
        given = _from_files(sources, document, unit) if _are_files(sources) else None
        scene = given or _from_run(sources, document, time, store)
        placed = turned_and_shifted(scene, _radians(turn), shift).model_dump(mode="json", exclude_none=True)
        scene = validated(Scene, override(placed, dict(map(parse_override, changes))))
    for number, vesicle in enumerate(scene.vesicles):
        _tell(
            f"vesicle {number}: length {vesicle.length:.6g}, reduced area {vesicle.reduced_area:.6g}, "
            f"center {vesicle.center[0]:.6g} {vesicle.center[1]:.6g}"
        )
    print(tomli_w.dumps(scene.model_dump(mode="json", exclude_none=True)), end="")


def _are_files(sources: list[str]) -> bool:
    from ensemble.config.outline_files import SUFFIXES

    return any(Path(source).suffix in SUFFIXES for source in sources)


def _from_files(files: list[str], document: str | None, unit: str | None) -> Scene:
    from ensemble.config.documents import load_scene
    from ensemble.config.given_start import from_curves
    from ensemble.config.outline_files import traced_in
    from solver.dimensions import LENGTH

    if document is None:
        raise ValueError("--scene — say which scene gets the shapes, such as vesicle-shear")
    scene = load_scene(document)
    scale = 1.0 if unit is None else LENGTH.number(f"1 {unit}", scene.units)
    curves = [traced_in(Path(file)) for file in files]
    for file, curve in zip(files, curves, strict=True):
        _tell(f"{file}: no point is farther than {scale * curve.distance:.3g} from the curve")
    return from_curves(scene, curves, scale)


def _from_run(sources: list[str], document: str | None, time: float | None, path: Path) -> Scene:
    from ensemble.config.documents import load_scene
    from ensemble.config.given_start import from_state, nearest_frame
    from ensemble.store import Store

    if len(sources) != 1:
        raise ValueError(f"one run, or files of points, got {len(sources)} names")
    with Store.existing(path) as store:
        run = store.load(store.full_key(sources[0]))
    frames = run.frames
    index = nearest_frame(frames, time)
    _tell(f"the state at time {frames.time[index]:g}")
    scene = run.scene if document is None else load_scene(document)
    if len(scene.vesicles) != len(run.scene.vesicles):
        raise ValueError(
            f"--scene has {len(scene.vesicles)} vesicles, and the run has {len(run.scene.vesicles)}"
        )
    sizes = {"reduced_area", "length"}
    vesicles = tuple(
        vesicle.model_copy(update=stored.model_dump(include=sizes) | {"tangent_angle": None})
        for vesicle, stored in zip(scene.vesicles, run.scene.vesicles, strict=True)
    )
    scene = scene.model_copy(update={"vesicles": vesicles})
    return from_state(scene, frames.tangent_angle[index], frames.center[index])


def _radians(text: str) -> float:
    from solver.dimensions import ANGLE

    try:
        return float(text)
    except ValueError:
        return ANGLE.number(text, None)


def _tell(line: str) -> None:
    print(f"ensemble: {line}", file=sys.stderr)
