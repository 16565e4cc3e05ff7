"""A kind of question as another distribution may add it: a scene at several values of one of its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field
from rich.table import Table

from ensemble.cli.options import AsJson, Changes, Document, ProgressAs, ProgressFormat, RanksPerRun, StorePath
from ensemble.cli.question_commands import answer_and_print
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.config.overrides import override
from ensemble.config.run_key import run_key
from ensemble.config.validation import validated
from ensemble.mpi.run_study import run_batch
from ensemble.mpi.store_on_ranks import store_on_ranks, whole_store
from ensemble.questions import Answer, Question
from ensemble.questions.size_limits import limit_elements, limit_vesicles
from solver.scene import Model, Scene


class Scan(Model):
    """A scene and the values that one of its numbers takes."""

    scene: Scene
    parameter: str
    values: tuple[float, ...] = Field(min_length=1)

    def scenes(self) -> list[Scene]:
        document = self.scene.model_dump()
        return [validated(Scene, override(document, {self.parameter: value})) for value in self.values]


class ScanQuestion(Question[Scan]):
    """What becomes of the scene at each value?"""

    kind = command = "scan"
    document_type = Scan
    marker = "values"
    title = "Run a scene at several values"
    principal_fields = ("values",)

    @classmethod
    def check_size(cls, document: Any) -> None:
        limit_vesicles(document, 4, "scene")
        limit_elements(document, 8, "values")

    def planned_runs(self) -> list[tuple[Scene, int]]:
        return [(scene, 1) for scene in self.document.scenes()]

    def answer(
        self, communicator: Any, store: Path | None, ranks_per_run: int, on_change: Callable[..., None]
    ) -> Answer | None:
        scenes = self.document.scenes()
        with store_on_ranks(communicator, store) as opened:
            run_batch(communicator, scenes, opened, on_change, ranks_per_run)
            if communicator.Get_rank() != 0:
                return None
            outcomes = [str(whole_store(opened).summary(run_key(scene)).outcome) for scene in scenes]
        return ScanAnswer(dict(zip(self.document.values, outcomes, strict=True)))

    @classmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        return ", ".join(f"{value}: {outcome}" for value, outcome in json_document.items())


@dataclass(frozen=True)
class ScanAnswer(Answer):
    """Outcomes by value."""

    outcomes: dict[float, str]

    @property
    def complete(self) -> bool:
        return "failed" not in self.outcomes.values()

    def json_document(self) -> dict[str, Any]:
        return {f"{value:g}": outcome for value, outcome in self.outcomes.items()}

    def table(self) -> Table:
        table = Table("value", "outcome")
        for value, outcome in self.json_document().items():
            table.add_row(value, outcome)
        return table


def scan(
    document: Document,
    changes: Changes = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    ranks_per_run: RanksPerRun = None,
    progress: ProgressAs = ProgressFormat.TEXT,
    as_json: AsJson = False,
) -> None:
    """Run a scene at several values of one of its numbers, on all ranks."""
    answer_and_print("scan", document, changes, store, ranks_per_run, progress, as_json)
