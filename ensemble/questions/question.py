"""What every kind of question provides."""

from __future__ import annotations

import hashlib
import json
import shlex
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

from ensemble.config.defaults import DEFAULT_STORE
from ensemble.config.documents import load
from ensemble.config.overrides import override
from ensemble.config.validation import validated
from ensemble.questions.cost import Cost, total_cost
from solver.scene import Model, Scene, Units

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.console import Console
    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.display.progress import Display
    from ensemble.store import Store
    from ensemble.store.columns import ListColumn
    from ensemble.store.listing import Listing

SomeDocument = TypeVar("SomeDocument", bound=Model)

KEY_DIGITS = 32  # hexadecimal

# Exit status of a command that gave an answer which is not complete.  It is no status of a failure (1, 2, or
# 128 and a signal), nor made of those of several ranks, which launchers combine bit by bit.
INCOMPLETE_STATUS = 4

SHORT_KEY = 8  # characters that tell the keys of a store apart, almost always


def where_kept(key: str, output: str, store: Path) -> str:
    """Say where an answer is kept and with which command it is drawn.

    Parameters
    ----------
    key : str
        Of the answer.
    output : str
        Name of a file that it can be drawn to.
    store : Path
        Directory of the store.

    Returns
    -------
    str
    """
    option = "" if store == DEFAULT_STORE else f" --store {shlex.quote(str(store))}"
    return f"kept in {store}; to draw it: ensemble show {key[:SHORT_KEY]} --output {output}{option}"


class Answer(ABC):
    """What a question has come to, as the command line prints it."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether everything that was asked is answered; else the exit status is `INCOMPLETE_STATUS`."""

    @property
    def status(self) -> int:
        """Exit status of the command that gives it."""
        return 0 if self.complete else INCOMPLETE_STATUS

    @abstractmethod
    def json_document(self) -> dict[str, Any]:
        """Return the answer as JSON data."""

    @abstractmethod
    def table(self) -> Table:
        """Return the answer as a table for people."""

    @property
    def footer(self) -> str | None:
        """A line below the table."""
        return None


class StoredAnswer(ABC):
    """An answer that a store has, as `ensemble show` presents it."""

    @abstractmethod
    def json_document(self) -> dict[str, Any]:
        """Return the whole record of the answer as JSON data."""

    @abstractmethod
    def table(self) -> Table:
        """Return the answer as a table for people."""

    @abstractmethod
    def in_units(self, units: Units) -> StoredAnswer:
        """Return the answer as if its scene had these units.

        Parameters
        ----------
        units : Units

        Returns
        -------
        StoredAnswer
        """

    @abstractmethod
    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw the answer to a file.

        Parameters
        ----------
        output : Path
            Its suffix names the format.
        options : FigureOptions
            Of a figure.
        on_progress : callable, optional
            Takes the number of pictures of a movie that are drawn, and of all.

        Raises
        ------
        ValueError
            If the answer cannot be drawn in this format; names those that are possible.
        """


@dataclass(frozen=True)
class StoredAnswers:
    """Several answers that a store has, as `ensemble query` presents them.

    Attributes
    ----------
    json_documents : iterator of dict
        One for each answer, as it was recorded.  They are read one after the other.
    columns : tuple of ListColumn
        What a table shows of each document.
    """

    json_documents: Iterator[dict[str, Any]]
    columns: tuple[ListColumn, ...]


class Question(ABC, Generic[SomeDocument]):
    """A question that has been checked.  A subclass is a kind of question.

    Parameters
    ----------
    document : Model
        Of the class `document_type`.
    name : str, optional
        What the question is called if its document does not say; by default as its kind.

    Attributes
    ----------
    kind : str
        Name of the kind, and of its documents in what is submitted to the service.
    document_type : type
        Model of its documents.
    marker : str
        Key at the top level of its documents by which they are recognized.  No other kind has it.
    command : str
        Command that answers a question of this kind.
    title : str
        What the command does, in a few words in the imperative.
    collection : str or None
        What its answers are called in the plural, where a store lists them; None if it keeps only their runs.
    answer_title : str
        What one answer is called.
    answer_grows : bool
        Whether the store has the answer, as far as it is known, while it is being worked on.
    has_many_runs : bool
        Whether it takes many runs, which ranks can make side by side.  If not, ranks share its only run.
    scene_path : str
        Dotted path of the scene in its documents; empty if they are scenes.
    principal_fields : tuple of str
        Fields outside the scene that people change most, by their dotted paths.
    """

    kind: ClassVar[str]
    document_type: ClassVar[type[Any]]
    marker: ClassVar[str]
    command: ClassVar[str]
    title: ClassVar[str]
    collection: ClassVar[str | None] = None
    answer_title: ClassVar[str] = "answer"
    answer_grows: ClassVar[bool] = False
    has_many_runs: ClassVar[bool] = True
    scene_path: ClassVar[str] = "scene"
    principal_fields: ClassVar[tuple[str, ...]] = ()

    def __init__(self, document: SomeDocument, name: str | None = None) -> None:
        self.document = document
        self.name: str = getattr(document, "name", None) or name or self.kind

    # From a document to a question.

    @classmethod
    def of(cls, document: Mapping[str, Any], name: str | None = None) -> Self:
        """Check a document and return the question that it asks.

        Parameters
        ----------
        document : mapping
            Nested tables and arrays.
        name : str, optional
            What the question is called if its document does not say; by default as its kind.

        Returns
        -------
        Question

        Raises
        ------
        ValueError
            If the document is not of this kind, or not valid; names the fields.
        """
        return cls(validated(cls.document_type, document), name)

    @classmethod
    def load(cls, name_or_path: str, changes: Mapping[str, Any]) -> Self:
        """Read a question from a preset or a TOML file.

        Parameters
        ----------
        name_or_path : str
            Name of a preset, else a file.
        changes : mapping from dotted path to value
            Made before the document is checked.

        Returns
        -------
        Question

        Raises
        ------
        ValueError
            If there is no such preset or file, or it is not valid; names the field.
        """
        return cls(load(cls.document_type, name_or_path, changes), Path(name_or_path).stem)

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the question with the values at some dotted paths replaced.

        Parameters
        ----------
        changes : mapping from dotted path to value
            Made to the document in full.

        Returns
        -------
        Question

        Raises
        ------
        ValueError
            If a change is not possible; names the field.
        """
        return self.of(override(self.document.model_dump(), changes), self.name) if changes else self

    @classmethod
    @abstractmethod
    def check_size(cls, document: Any) -> None:
        """Refuse a document that is too large for a service, before any work is done on it.

        Parameters
        ----------
        document : object
            What was sent; it has not been checked and may be anything.

        Raises
        ------
        ValueError
            With the number that is allowed.
        """

    # What the question is.

    @cached_property
    def key(self) -> str:
        """Key of its answer: equal questions have equal keys."""
        return hashlib.sha256(f"{self.kind} {self.text}".encode()).hexdigest()[:KEY_DIGITS]

    @property
    def scene(self) -> Scene:
        """The scene in its document, which decides how many ranks pay off for a run."""
        document: Any = self.document
        scene: Scene = attrgetter(self.scene_path)(document) if self.scene_path else document
        return scene

    @cached_property
    def fields(self) -> dict[str, Any]:
        """The document as JSON data, with nothing left to a default."""
        return self.document.model_dump(mode="json", exclude_none=True)

    @cached_property
    def text(self) -> str:
        """The document as JSON text, the same for equal documents."""
        return json.dumps(self.fields, sort_keys=True)

    # What it costs.

    @abstractmethod
    def planned_runs(self) -> Iterable[tuple[Scene, int]]:
        """Return scenes and, for each, how many runs may be needed that cost at most as much as its run."""

    @cached_property
    def cost(self) -> Cost:
        """What the answer costs at most."""
        return total_cost(self.planned_runs())

    # How it is answered.

    @abstractmethod
    def answer(
        self,
        communicator: Intracomm | None,
        store: Path | None,
        ranks_per_run: int,
        on_change: Callable[..., None],
    ) -> Answer | None:
        """Answer the question.

        Collective.

        Parameters
        ----------
        communicator : Intracomm or None
            The ranks that take part; None if this process is alone, which it may be for a single run.
        store : Path or None
            Directory of a store, which exists; None only if the command does without.
        ranks_per_run : int
            How many ranks compute a run together.
        on_change : callable
            What `progress` gives.

        Returns
        -------
        Answer or None
            On the first rank; others may return None.
        """

    @classmethod
    def progress(cls, console: Console, for_program: bool) -> Display:
        """Return what shows the progress of an answer.

        Parameters
        ----------
        console : Console
            Where it is shown.
        for_program : bool
            Whether it is read by a program, in lines of JSON.

        Returns
        -------
        context manager
            Gives the function that `answer` takes as ``on_change``.  By default it takes a `JobProgress`.
        """
        from ensemble.display.progress import job_lines, job_progress

        return job_lines(console) if for_program else job_progress(console)

    # How an answer is presented.

    @classmethod
    @abstractmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        """Return the JSON document of an answer in a few words.

        Parameters
        ----------
        json_document : mapping
            As the command prints it.

        Returns
        -------
        str
        """

    @classmethod
    def stored(cls, store: Store, name: str) -> StoredAnswer | None:
        """Return an answer of this kind that a store has.

        Parameters
        ----------
        store : Store
            An open store.
        name : str
            Key of the answer, as much of it as no other key begins with, or a name by which people know it.

        Returns
        -------
        StoredAnswer or None
            None if the store has none of this name.

        Raises
        ------
        ValueError
            If there are several; names them.
        """
        return None

    @classmethod
    def all_stored(cls, store: Store, listing: Listing, columns: Sequence[str]) -> StoredAnswers:
        """Return the answers of this kind that a store has.

        Parameters
        ----------
        store : Store
            An open store.
        listing : Listing
            Which answers, and in which order.
        columns : sequence of str
            Dotted paths of the fields that a table shows; if empty, those that are usual for this kind.

        Returns
        -------
        StoredAnswers

        Raises
        ------
        ValueError
            If the store lists no answers of this kind.
        """
        raise ValueError(f"{cls.kind}: a store keeps only the runs of such an answer")
