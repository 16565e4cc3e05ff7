"""What a run records, handed over in blocks: so that a long run needs no more memory than a short one.

A record has the parts that a `Run` has, ``series``, ``vesicle_series`` and ``frames``.  A block is some
successive rows of one part: its arrays by name, with the samples or frames along the first dimension.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.run import Frames, Run
from solver.membrane.resampling import resampled_angle
from solver.membrane.spectral import resampled
from solver.memory import Remembering, Saved

if TYPE_CHECKING:
    from solver.analysis.run import RunResults

Array = NDArray[np.float64]
Block = Mapping[str, Array]
Row = Mapping[str, "float | Array"]

SERIES, VESICLE_SERIES, FRAMES = "series", "vesicle_series", "frames"
BLOCK_BYTES = 1 << 18


class Sink(Remembering, ABC):
    """Takes what a run records.  It remembers how much that is, and whatever no other place keeps."""

    @abstractmethod
    def take(self, part: str, block: Block) -> None:
        """Take the next rows.

        Parameters
        ----------
        part : str
            Of the record.
        block : mapping of str to array
            At least one row.
        """


class InMemory(Sink):
    """Keeps all blocks."""

    memory = ("_blocks",)

    def __init__(self) -> None:
        self._blocks: dict[str, list[Block]] = {}

    def take(self, part: str, block: Block) -> None:
        """Keep a block; see `Sink`.

        Parameters
        ----------
        part : str
        block : mapping of str to array
        """
        self._blocks.setdefault(part, []).append(block)

    def run(self, results: RunResults) -> Run:
        """Put the record and the results of a run together.

        Parameters
        ----------
        results : RunResults
            Of the run that has been recorded.

        Returns
        -------
        Run
        """
        assert results.work.points
        frames = [with_points(block, results.work.points) for block in self._blocks[FRAMES]]
        return Run(
            **{field.name: getattr(results, field.name) for field in fields(results)},
            series=_joined(self._blocks[SERIES]),
            vesicle_series=_joined(self._blocks.get(VESICLE_SERIES, [])),
            frames=Frames(**_joined(frames)),
        )


class Forgetful(Sink):
    """Keeps nothing but the names of what is recorded.

    Attributes
    ----------
    names : dict of str to tuple of str
        By the part of the record.
    """

    def __init__(self) -> None:
        self.names: dict[str, tuple[str, ...]] = {}

    def take(self, part: str, block: Block) -> None:
        """Forget a block; see `Sink`.

        Parameters
        ----------
        part : str
        block : mapping of str to array
        """
        self.names[part] = tuple(block)

    def restore(self, saved: Saved) -> None:
        """Remember nothing, whatever another sink has saved.

        Parameters
        ----------
        saved : dict
        """


class OpenBlock(Remembering):
    """The rows that have not been handed over.

    Parameters
    ----------
    part : str
        Of the record.
    sink : Sink
        That takes them once they are `BLOCK_BYTES`.
    """

    memory = ("_rows",)

    def __init__(self, part: str, sink: Sink) -> None:
        self._part = part
        self._sink = sink
        self._rows: dict[str, list[float | Array]] = {}
        self._row_bytes = 0

    def add(self, row: Row) -> None:
        """Take in a row.

        Parameters
        ----------
        row : mapping
            Its values by name.
        """
        rows = self._rows
        if not rows:
            rows.update({name: [] for name in row})
        for name, value in row.items():
            rows[name].append(value)
        if not self._row_bytes:
            self._row_bytes = sum(np.asarray(value).nbytes for value in row.values())
        if len(rows[name]) * self._row_bytes >= BLOCK_BYTES:
            self.hand_over()

    def hand_over(self) -> None:
        """Give the rows to the sink, if there are any."""
        if self._rows:
            self._sink.take(self._part, open_rows(self.saved()))
            self._rows, self._row_bytes = {}, 0


def open_rows(saved: Saved) -> Block:
    """Return the rows of an `OpenBlock` that was saved.

    Parameters
    ----------
    saved : dict

    Returns
    -------
    dict of str to array
    """
    return {name: np.array(values) for name, values in saved["_rows"].items()}


def with_points(frames: Block, points: int) -> Block:
    """Interpolate a block of frames to at least as many points as it has.

    Parameters
    ----------
    frames : mapping of str to array
    points : int

    Returns
    -------
    mapping of str to array
    """
    if frames["tension"].shape[-1] == points:
        return frames
    return {
        **frames,
        "tangent_angle": resampled_angle(frames["tangent_angle"], points),
        "tension": resampled(frames["tension"], points),
    }


def _joined(blocks: list[Block]) -> dict[str, Array]:
    return {name: np.concatenate([block[name] for block in blocks]) for name in (blocks[0] if blocks else ())}
