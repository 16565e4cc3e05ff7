"""Questions that the package answers, one module for each kind: a study, a map, a measurement, a scene.

The command line and the service know of a kind only what `Question` states.  To add a kind:

1. Write the model of its documents as a subclass of `solver.scene.Model`, with a top-level key (the *marker*)
   that no other kind has.
2. Subclass `Question` in a module of this folder: `kind`, `document_type`, `marker`, `command` and `title`,
   then `check_size`, `planned_runs`, `answer` and `summary`.  `ensemble.mpi.run_study` has `run_batch` for
   scenes that are all known beforehand, and `run_queue` for those that follow from outcomes.
3. Enter the class in `KINDS` below.  Another distribution enters its own under the entry point group
   `ensemble.questions` instead.
4. Add its command to `ensemble.cli.question_commands`: a signature and one call of `answer_and_print`.
   Workers of the service pass it a file and the options ``--store``, ``--progress`` and ``--json``.
5. If the store keeps the answers, and not only the runs, override `stored` and `all_stored`.
6. Ship a preset in `ensemble/presets/`, and test it.  `tests/scan_kind.py` is a whole kind in 100 lines.
   `tests/api/test_added_kind.py` carries it through the command line and the service.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from ensemble.config.documents import preset_document
from ensemble.config.overrides import override
from ensemble.questions.question import INCOMPLETE_STATUS, Answer, Question, StoredAnswer, StoredAnswers
from solver.scene import Model

__all__ = [
    "INCOMPLETE_STATUS",
    "Answer",
    "Question",
    "StoredAnswer",
    "StoredAnswers",
    "kind_named",
    "kind_of",
    "kind_of_model",
    "kinds",
    "preset_question",
]

GROUP: Final = "ensemble.questions"
KINDS: Final = (
    EntryPoint("study", "ensemble.questions.study_question:StudyQuestion", GROUP),
    EntryPoint("map", "ensemble.questions.map_question:MapQuestion", GROUP),
    EntryPoint("measurement", "ensemble.questions.measurement_question:MeasurementQuestion", GROUP),
    EntryPoint("scene", "ensemble.questions.scene_question:SceneQuestion", GROUP),
)


@cache
def kinds() -> tuple[type[Question[Any]], ...]:
    """Return all kinds of question, those of other distributions last."""
    return tuple(entry.load() for entry in (*KINDS, *entry_points(group=GROUP)))


def kind_named(name: str) -> type[Question[Any]]:
    """Return the kind of question of this name.

    Parameters
    ----------
    name : str
        Such as ``study``.

    Returns
    -------
    type

    Raises
    ------
    ValueError
        If there is no such kind; names those that there are.
    """
    for kind in kinds():
        if kind.kind == name:
            return kind
    raise ValueError(f"{name!r} is no kind of question; kinds: {', '.join(kind.kind for kind in kinds())}")


def kind_of(document: Mapping[str, Any]) -> type[Question[Any]]:
    """Return the kind of question that a document asks, recognized by its marker.

    Parameters
    ----------
    document : mapping
        Nested tables and arrays, not yet checked.

    Returns
    -------
    type

    Raises
    ------
    ValueError
        If the document has the marker of no kind or of several.
    """
    recognized = [kind for kind in kinds() if kind.marker in document]
    if len(recognized) == 1:
        return recognized[0]
    markers = ", ".join(f"{kind.marker!r} ({kind.kind})" for kind in kinds())
    raise ValueError(f"a document must have exactly one of the keys {markers}")


def kind_of_model(model: Model) -> type[Question[Any]]:
    """Return the kind of question whose documents are of a model's class.

    Parameters
    ----------
    model : Model
        Such as a `Study`.

    Returns
    -------
    type

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    for kind in kinds():
        if isinstance(model, kind.document_type):
            return kind
    raise ValueError(f"{type(model).__name__}: no kind of question has such documents")


def preset_question(name: str, changes: Mapping[str, Any]) -> Question[Any]:
    """Return the question that a preset asks, with the values at some dotted paths replaced.

    Parameters
    ----------
    name : str
        Name of the preset.
    changes : mapping from dotted path to value
        Made before the document is checked.

    Returns
    -------
    Question

    Raises
    ------
    ValueError
        If there is no such preset, or it does not allow one of the changes; names the field.
    """
    if not changes:
        return _unchanged_preset(name)
    document = preset_document(name)
    return kind_of(document).of(override(document, changes), name)


@cache
def _unchanged_preset(name: str) -> Question[Any]:
    # Checked once: most jobs of a service are a preset without changes.
    document = preset_document(name)
    return kind_of(document).of(document, name)
