"""What the READMEs say exists: files, links, modules, fields of scenes and studies, commands, presets.

Their words are those of the field.
"""

from __future__ import annotations

import importlib
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from ensemble.config.study import Study
from solver.scene import Scene
from tests.documentation.command_line import COMMAND_LINE, option_names

ROOT = Path(__file__).parents[2]
PACKAGES = ("solver", "ensemble", "api")

# Words that only this project knew, and what took their place.
RETIRED = {
    "agenda": "task queue",
    "coordinator": "study planner",
    "gliding": "tangential velocity",
    "glide": "move along the membrane",
    "inquiry": "point search",
    "offer": "submit",
    "standing": "progress",
}
_FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", flags=re.MULTILINE | re.DOTALL)


def documents() -> list[Path]:
    """All Markdown files that Git follows or would."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return [ROOT / name for name in listed.stdout.split()]


DOCUMENTS = documents()
each_document = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def prose(text: str) -> str:
    """A document without its fenced code and formulas."""
    return re.sub(r"\$[^$\n]+\$", "", _FENCE.sub("", text))


def code(text: str, language: str) -> list[str]:
    """The fenced blocks in a language."""
    return [body for found, body in _FENCE.findall(text) if found == language]


def anchors(text: str) -> set[str]:
    """What a link may name in a document: its headings, as GitHub writes them."""
    headings = re.findall(r"^#+ (.+)$", _FENCE.sub("", text), flags=re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


@each_document
def test_links_lead_somewhere(path: Path) -> None:
    lost = []
    for target in re.findall(r"\]\(([^)\s]+)\)", _FENCE.sub("", path.read_text())):
        if re.match(r"https?://", target):
            continue
        file, _, anchor = target.partition("#")
        destination = (path.parent / file) if file else path
        if not destination.exists() or (anchor and anchor not in anchors(destination.read_text())):
            lost.append(target)
    assert not lost


@each_document
def test_files_and_modules_exist(path: Path) -> None:
    written = set(re.findall(r"Write `([^`]+)`", path.read_text()))  # by the reader of a guide
    files = {name for name in quoted(path) if _is_file(name)}
    lost = [name for name in files - written if not _file_exists(name, path.parent)]
    lost += [name for name in set(quoted(path)) - files if _is_module(name) and not _module_exists(name)]
    assert not lost


@each_document
def test_fields_exist(path: Path) -> None:
    assert not [name for name in quoted(path) if _is_field(name) and not _field_exists(name)]


def quoted(path: Path) -> list[str]:
    """What a document quotes in single backticks, without values that are set."""
    return [name.split("=")[0].strip() for name in re.findall(r"`([^`\n]+)`", prose(path.read_text()))]


def _is_file(name: str) -> bool:
    known = re.fullmatch(r"[\w./*@-]+\.(py|md|toml|cff|js|css|html|slurm|service|yaml|png|svg)", name)
    inside = re.fullmatch(rf"({'|'.join(PACKAGES)}|tests|deploy)/[\w./*-]*", name)
    example = name.startswith(("my-", "run.", "phase-diagram.", "/"))
    return bool(known or inside) and not example


def _file_exists(name: str, beside: Path) -> bool:
    """Whether a file has this path from the root, or this name anywhere beside the document."""
    below = beside.rglob(name.rstrip("/")) if beside != ROOT else ROOT.glob(name.rstrip("/"))
    return any(below) or any(ROOT.glob(name.rstrip("/")))


def _is_module(name: str) -> bool:
    return bool(re.fullmatch(rf"({'|'.join(PACKAGES)})(\.\w+)+", name))


def _module_exists(name: str) -> bool:
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def _is_field(name: str) -> bool:
    first = name.split(".")[0]
    return bool(re.fullmatch(r"[a-z_]+(\.[a-z_0-9]+)+", name)) and (
        first in Scene.model_fields or first in Study.model_fields
    )


def _field_exists(name: str) -> bool:
    return any(_has_field(model, name.split(".")) for model in (Scene, Study))


def _has_field(kind: Any, path: list[str]) -> bool:
    """Whether a model, or any model in a union or tuple, has a field at this path."""
    if not path:
        return True
    models = list(_models(kind))
    rest = path[1:] if path[0].isdigit() else path
    if len(rest) < len(path):
        return any(_has_field(model, rest) for model in models)
    return any(
        path[0] in model.model_fields and _has_field(model.model_fields[path[0]].annotation, path[1:])
        for model in models
    )


def _models(kind: Any) -> Iterator[type[BaseModel]]:
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    for argument in get_args(kind):
        yield from _models(argument)


def commands(path: Path) -> list[list[str]]:
    """Every `ensemble` command in a document's shell blocks and quotations, split into words."""
    text = path.read_text()
    lines = [line for block in code(text, "sh") for line in block.replace("\\\n", " ").splitlines()]
    lines += re.findall(r"`([^`]+)`", prose(text))
    found = []
    for line in lines:
        for part in line.split("&&"):
            words = shlex.split(part, comments=True) if part.count("'") % 2 == 0 else part.split()
            if "ensemble" in words:
                found.append(words[words.index("ensemble") + 1 :])
    return found


@each_document
def test_commands_have_the_options_that_they_are_given(path: Path) -> None:
    unknown = []
    for words in commands(path):
        command, known = COMMAND_LINE, option_names(COMMAND_LINE)
        for word in words:
            if hasattr(command, "commands") and not word.startswith("-"):  # a group
                command = command.commands.get(word)
                known |= option_names(command)
            elif word.startswith("--") and word.split("=")[0] not in known:
                unknown.append(word)
        if command is None:
            unknown.append(" ".join(words))
    assert not unknown


@each_document
def test_presets_exist(path: Path) -> None:
    presets = {preset.stem for preset in (ROOT / "ensemble" / "presets").glob("*.toml")}
    asked = [words[1] for words in commands(path) if len(words) > 1 and words[0] in ("run", "bisect")]
    named = {name for name in asked if re.fullmatch(r"[a-z][a-z-]+", name)}
    assert not named - presets


def test_the_readme_lists_every_preset() -> None:
    presets = {preset.stem for preset in (ROOT / "ensemble" / "presets").glob("*.toml")}
    listed = {name for path in DOCUMENTS for name in quoted(path)}
    assert not presets - listed


def test_words_are_not_ours_alone() -> None:
    sources = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    retired = re.compile(rf"\b({'|'.join(RETIRED)})s?\b", flags=re.IGNORECASE)
    assert not {
        str(path.relative_to(ROOT)): {word.lower(): RETIRED[word.lower()] for word in words}
        for path in DOCUMENTS + sources
        if (words := set(retired.findall(path.read_text())))
    }


@each_document
def test_lines_fit(path: Path) -> None:
    lines = (line for line in path.read_text().splitlines() if not line.startswith("|"))
    assert not [line for line in lines if len(line) > 120]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


def test_the_readme_begins_with_its_two_commands() -> None:
    first, second = code((ROOT / "README.md").read_text(), "sh")[:2]
    for block, end in ((first, "ensemble bisect"), (second, "pytest")):
        (line,) = block.splitlines()
        assert line.startswith("python3 -m venv .venv && . .venv/bin/activate && pip install ")
        assert line.endswith(end)


def test_the_citation_is_of_the_last_release() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    version = re.search(r"^version: (.+)$", citation, flags=re.MULTILINE)
    date = re.search(r'^date-released: "(.+)"$', citation, flags=re.MULTILINE)
    release = re.search(r"^## \[(\d.*)\] - (.+)$", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    assert version
    assert date
    assert release
    assert (version[1], date[1]) == (release[1], release[2])


def test_the_version_is_that_of_the_last_release_or_under_development() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    changes = (ROOT / "CHANGELOG.md").read_text()
    assert f"## [{version}]" in changes or (".dev" in version and "## [Unreleased]" in changes)
