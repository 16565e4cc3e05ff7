"""Scenes and studies of a section, each with the command that runs it by itself."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

from ensemble.config.documents import load_scene, load_study
from ensemble.config.run_key import run_key
from ensemble.config.study import Study
from solver.scene import Scene


@dataclass(frozen=True)
class _Varied:
    """A preset with changes, given as ``path=value`` exactly as the command line takes them."""

    preset: str
    changes: tuple[str, ...] = ()

    @classmethod
    def of(cls, preset: str, changes: Mapping[str, Any] | None = None) -> Self:
        """Name a preset and the values at some of its dotted paths."""
        return cls(preset, _texts(changes or {}))

    def but(self, changes: Mapping[str, Any]) -> Self:
        """Return this with further changes."""
        return type(self)(self.preset, (*self.changes, *_texts(changes)))

    def _command(self, verb: str) -> str:
        options = [part for change in self.changes for part in ("--set", change)]
        return shlex.join(["ensemble", verb, self.preset, *options])


@dataclass(frozen=True)
class Case(_Varied):
    """One run: a preset scene with changes."""

    @cached_property
    def scene(self) -> Scene:
        """The scene; `ValueError` names a field that does not allow its change."""
        return load_scene(self.preset, self.changes)

    @cached_property
    def key(self) -> str:
        """Key of the run."""
        return run_key(self.scene)

    @property
    def command(self) -> str:
        """What makes this very run, with the same key, by itself."""
        return self._command("run")


@dataclass(frozen=True)
class StudyCase(_Varied):
    """One boundary: a preset study with changes."""

    @cached_property
    def study(self) -> Study:
        """The study; `ValueError` names a field that does not allow its change."""
        return load_study(self.preset, self.changes)

    @property
    def command(self) -> str:
        """What traces this very boundary by itself."""
        return self._command("bisect")


def _texts(changes: Mapping[str, Any]) -> tuple[str, ...]:
    # Numbers, strings and arrays of them are the same in JSON and in TOML.
    return tuple(f"{path}={json.dumps(value)}" for path, value in changes.items())
