"""Documents of studies and scenes: presets, which ship with the package, and TOML files."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from itertools import takewhile
from pathlib import Path
from typing import Any, TypeVar

from ensemble.config.overrides import override, parse_override
from ensemble.config.study import Study
from ensemble.config.validation import nearest, validated
from solver.scene import Model, Scene, Units

SomeDocument = TypeVar("SomeDocument", bound=Model)


def preset_names() -> tuple[str, ...]:
    """Return the names of the presets, sorted."""
    return tuple(sorted(_presets()))


def preset_document(name: str) -> dict[str, Any]:
    """Return the document of a preset as its file holds it.

    Parameters
    ----------
    name : str
        Name of the preset.

    Returns
    -------
    dict
        A copy, which may be changed.

    Raises
    ------
    ValueError
        If there is no such preset.
    """
    if name not in preset_names():
        raise ValueError(f"{name!r} is not a preset; {_presets_like(name)}")
    return copy.deepcopy(_presets()[name])


def preset_text(name: str) -> str:
    """Return the TOML document of a preset, comments included.

    Parameters
    ----------
    name : str
        Name of the preset.

    Returns
    -------
    str
    """
    return (files("ensemble") / "presets" / f"{name}.toml").read_text(encoding="utf-8")


def preset_description(name: str) -> str:
    """Return what a preset is: the comment at its head, up to the source.

    Parameters
    ----------
    name : str
        Name of the preset.

    Returns
    -------
    str
        One sentence.
    """
    lines = takewhile(lambda line: line.startswith("#"), preset_text(name).splitlines())
    sentence, _, _ = " ".join(line.lstrip("# ") for line in lines).partition(". ")
    return sentence


@cache
def _presets() -> dict[str, dict[str, Any]]:
    # They do not change, and the service is asked for them hundreds of times a second.
    presets = (file for file in (files("ensemble") / "presets").iterdir() if file.name.endswith(".toml"))
    return {Path(file.name).stem: tomllib.loads(preset_text(Path(file.name).stem)) for file in presets}


def _presets_like(name: str) -> str:
    """Return the preset that is meant most likely, and else all of them."""
    similar = nearest(name, preset_names())
    return f"did you mean {similar!r}?" if similar else f"presets: {', '.join(preset_names())}"


def read_document(name_or_path: str | Path) -> dict[str, Any]:
    """Return the document of a preset or of a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a file.

    Returns
    -------
    dict
        Nested tables and arrays.

    Raises
    ------
    ValueError
        If there is no such preset or file, or the file is not TOML.
    """
    if str(name_or_path) in preset_names():
        return preset_document(str(name_or_path))
    path = Path(name_or_path)
    if not path.is_file():
        raise ValueError(
            f"{str(name_or_path)!r} is neither a file nor a preset; {_presets_like(str(name_or_path))}"
        )
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def load(model: type[SomeDocument], name_or_path: str | Path, changes: Mapping[str, Any]) -> SomeDocument:
    """Read a preset or a TOML file, change it and check it.

    Parameters
    ----------
    model : type
        The model that the changed document has to fit.
    name_or_path : str or Path
        Name of a preset, else a file.
    changes : mapping from dotted path to value
        As `ensemble.config.overrides.override` takes them.

    Returns
    -------
    Model
        An instance of the model.

    Raises
    ------
    ValueError
        If there is no such preset or file, or it does not fit the model; names the field.
    """
    document = read_document(name_or_path)
    try:
        return validated(model, override(document, changes))
    except ValueError as error:
        raise ValueError(f"{name_or_path}: {error}") from error


def load_study(name_or_path: str | Path, overrides: Iterable[str] = ()) -> Study:
    """Read a study from a preset or a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a file.
    overrides : iterable of str
        ``path=value`` with paths from the top of the document, such as ``scene.numerics.points=128``.

    Returns
    -------
    Study

    Raises
    ------
    ValueError
        If there is no such preset or file, or it is not a valid study; names the field.
    """
    return load(Study, name_or_path, dict(map(parse_override, overrides)))


def load_scene(name_or_path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read a scene from a preset or a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a file.
    overrides : iterable of str
        ``path=value``, such as ``flow.rate=0.5``.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        If there is no such preset or file, or it is not a valid scene; names the field.
    """
    return load(Scene, name_or_path, dict(map(parse_override, overrides)))


def load_units(name_or_path: str | Path) -> Units:
    """Read the units of the scene of a document, whatever else it holds.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a TOML file.

    Returns
    -------
    Units

    Raises
    ------
    ValueError
        If there is no such preset or file, or it has no valid units.
    """
    document = read_document(name_or_path)
    scene = document.get("scene", document)
    if not isinstance(scene, Mapping) or scene.get("units") is None:
        raise ValueError(f"{name_or_path}: units — its scene has no such table")
    try:
        return validated(Units, scene["units"])
    except ValueError as error:
        raise ValueError(f"{name_or_path}: units: {error}") from error
