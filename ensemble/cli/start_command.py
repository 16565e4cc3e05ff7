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

# Beyond, an angle or a place has lost its digits.
_LARGEST_TURN, _LARGEST_SHIFT = 1e6, 1e9


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
        angle, offset = _radians(turn), _within_reach(shift)
        files = _are_files(sources)
        _check_used(files, time, unit, store)
        scene = _from_files(sources, document, unit) if files else _from_run(sources, document, time, store)
        placed = turned_and_shifted(scene, angle, offset).model_dump(mode="json", exclude_none=True)
        scene = validated(Scene, override(placed, dict(map(parse_override, changes))))
    _tell_start(scene)
    print(tomli_w.dumps(scene.model_dump(mode="json", exclude_none=True)), end="")


def _are_files(sources: list[str]) -> bool:
    """Return whether all sources are files rather than a run."""
    from ensemble.config.outline_files import SUFFIXES

    files = [name for name in sources if Path(name).suffix.lower() in SUFFIXES or Path(name).is_file()]
    if files and len(files) < len(sources):
        other = next(name for name in sources if name not in files)
        raise ValueError(f"one run, or files of points: {files[0]!r} is a file, and {other!r} is none")
    return bool(files)


def _check_used(are_files: bool, time: float | None, unit: str | None, store: Path) -> None:
    """Refuse an option that would change nothing."""
    if are_files and time is not None:
        raise ValueError("--time — is one of a stored run, and these are files")
    if are_files and store != DEFAULT_STORE:
        raise ValueError("--store — is that of stored runs, and these are files")
    if unit is not None and not are_files:
        raise ValueError("--unit — is that of points in files, and this is a stored run")


def _from_files(files: list[str], document: str | None, unit: str | None) -> Scene:
    from ensemble.config.given_start import from_curves
    from ensemble.config.outline_files import traced_in
    from solver.dimensions import LENGTH

    if document is None:
        raise ValueError("--scene — say which scene gets the shapes, such as vesicle-shear")
    scene = _scene_in(document)
    try:
        scale = 1.0 if unit is None else LENGTH.number(f"1 {unit}", scene.units)
    except ValueError as error:
        raise ValueError(f"--unit: {unit!r} — {error}") from None
    curves = [traced_in(Path(file)) for file in files]
    for file, curve in zip(files, curves, strict=True):
        _tell(f"{file}: no point is farther than {scale * curve.distance:.3g} from the curve")
    return from_curves(scene, curves, scale)


def _from_run(sources: list[str], document: str | None, time: float | None, path: Path) -> Scene:
    from ensemble.config.given_start import from_state, nearest_frame
    from ensemble.store import Store

    if len(sources) != 1:
        raise ValueError(f"one run, or files of points, got {len(sources)} names")
    with Store.existing(path) as store:
        run = store.load(store.full_key(sources[0]))
    frames = run.frames
    index = nearest_frame(frames, time)
    _tell(f"the state at time {frames.time[index]:g}")
    scene = run.scene if document is None else _scene_in(document)
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


def _scene_in(document: str) -> Scene:
    """Read the scene that ``--scene`` names."""
    from ensemble.config.documents import load_scene, read_document
    from ensemble.questions import kind_of

    try:
        kind = kind_of(read_document(document)).kind
        if kind != "scene":
            raise ValueError(f"{document} is a {kind}, and must be a scene")
        return load_scene(document)
    except ValueError as error:
        raise ValueError(f"--scene: {error}") from error


def _radians(text: str) -> float:
    try:
        angle = float(text)
    except ValueError:
        angle = _in_radians(text)
    if not abs(angle) <= _LARGEST_TURN:
        raise ValueError(f"--turn: {text!r} — must be from -{_LARGEST_TURN:g} to {_LARGEST_TURN:g} radians")
    return angle


def _in_radians(text: str) -> float:
    from solver.dimensions import ANGLE

    try:
        return ANGLE.number(text, None)
    except ValueError as error:
        raise ValueError(f"--turn: {text!r} — {error}") from None


def _within_reach(shift: tuple[float, float]) -> tuple[float, float]:
    if not all(abs(each) <= _LARGEST_SHIFT for each in shift):
        given = " ".join(f"{each:g}" for each in shift)
        raise ValueError(f"--shift: {given} — must be from -{_LARGEST_SHIFT:g} to {_LARGEST_SHIFT:g}")
    return shift


def _tell_start(scene: Scene) -> None:
    if scene.protocol is not None:
        _tell("the protocol of the flow begins at time 0 of the new run")
    for number, vesicle in enumerate(scene.vesicles):
        _tell(
            f"vesicle {number}: length {vesicle.length:.6g}, reduced area {vesicle.reduced_area:.6g}, "
            f"center {vesicle.center[0]:.6g} {vesicle.center[1]:.6g}"
        )


def _tell(line: str) -> None:
    print(f"ensemble: {line}", file=sys.stderr)
