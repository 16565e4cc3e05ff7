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
class _PresetWithChanges:
    """A preset with changes.

    Attributes
    ----------
    preset : str
        Name of the preset.
    changes : tuple of str
        Changes as ``path=value``, exactly as the command line takes them.
    """

    preset: str
    changes: tuple[str, ...] = ()

    @classmethod
    def of(cls, preset: str, changes: Mapping[str, Any] | None = None) -> Self:
        """Return a preset with changes.

        Parameters
        ----------
        preset : str
            Name of the preset.
        changes : mapping of str to any, optional
            Values by their dotted path.

        Returns
        -------
        Case or StudyCase
            The preset with these changes.
        """
        return cls(preset, _overrides(changes or {}))

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """Return the same preset with further changes.

        Parameters
        ----------
        changes : mapping of str to any
            Values by their dotted path.

        Returns
        -------
        Case or StudyCase
            The preset with all changes; later ones replace earlier ones.
        """
        return type(self)(self.preset, (*self.changes, *_overrides(changes)))

    def _command(self, verb: str) -> str:
        options = [part for change in self.changes for part in ("--set", change)]
        return shlex.join(["ensemble", verb, self.preset, *options])


@dataclass(frozen=True)
class Case(_PresetWithChanges):
    """One run: a preset scene with changes."""

    @cached_property
    def scene(self) -> Scene:
        """The scene; raises `ValueError` with the name of a field that does not allow its change."""
        return load_scene(self.preset, self.changes)

    @cached_property
    def key(self) -> str:
        """Key of the run."""
        return run_key(self.scene)

    @property
    def command(self) -> str:
        """Command that makes this very run, with the same key."""
        return self._command("run")


@dataclass(frozen=True)
class StudyCase(_PresetWithChanges):
    """One boundary: a preset study with changes."""

    @cached_property
    def study(self) -> Study:
        """The study; raises `ValueError` with the name of a field that does not allow its change."""
        return load_study(self.preset, self.changes)

    @property
    def command(self) -> str:
        """Command that traces this very boundary."""
        return self._command("bisect")


def _overrides(changes: Mapping[str, Any]) -> tuple[str, ...]:
    # Numbers, strings and arrays of them are written the same in JSON and in TOML.
    return tuple(f"{path}={json.dumps(value)}" for path, value in changes.items())
