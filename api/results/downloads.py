"""Files of runs and boundaries: figures, movies, HDF5 and tables.

Figures, movies and HDF5 are made by the command line in a process of its own, at low priority and in limited
memory, so that the service answers meanwhile.  Few are made at a time; who asks for more is told to wait.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum
from http import HTTPStatus
from io import StringIO
from pathlib import Path
from threading import Semaphore
from typing import Any, BinaryIO

from ensemble.errors import BadInput, EnsembleError
from ensemble.search.boundary import Boundary

SECONDS = 300.0  # until a file is given up
AT_A_TIME = 2  # each keeps a thread of the service
PIECE_BYTES = 1 << 16

_REFUSED = 2  # exit status


class NoFile(EnsembleError):  # noqa: N818
    """A file could not be made now; perhaps later."""


class RunFile(StrEnum):
    """What a run can be downloaded as; the value is the suffix of the file."""

    HDF5 = "h5"
    VTK = "vtkhdf"
    GIF = "gif"
    MP4 = "mp4"
    PNG = "png"
    SVG = "svg"
    PDF = "pdf"


class BoundaryFile(StrEnum):
    """What a boundary can be downloaded as; the value is the suffix of the file."""

    CSV = "csv"
    PNG = "png"
    SVG = "svg"
    PDF = "pdf"


# By suffix, which formats of runs and of boundaries share.
MEDIA_TYPES: Mapping[str, str] = {
    "h5": "application/x-hdf5",
    "vtkhdf": "application/x-hdf5",
    "gif": "image/gif",
    "mp4": "video/mp4",
    "png": "image/png",
    "svg": "image/svg+xml",
    "pdf": "application/pdf",
    "csv": "text/csv",
}


class Downloads:
    """Makes files, from any thread.

    Parameters
    ----------
    store : Path
        Directory of the store.
    memory : int
        Bytes that a process may use which makes one.
    """

    def __init__(self, store: Path, memory: int) -> None:
        self._store = store
        self._memory = memory
        self._free = Semaphore(AT_A_TIME)

    def pieces(self, key: str, suffix: str) -> Iterator[bytes]:
        """Make a file and return its content.

        Parameters
        ----------
        key : str
            Of a run or a boundary that is stored.
        suffix : str
            Value of a `RunFile` or a `BoundaryFile`, not a table.

        Returns
        -------
        iterator of bytes

        Raises
        ------
        BadInput
            If it cannot be made, such as a movie without an encoder.
        NoFile
            If it takes too long, or too many files are asked for.
        """
        if not self._free.acquire(blocking=False):
            raise NoFile("other files are being made; ask again later")
        try:
            with tempfile.TemporaryDirectory(prefix="ensemble-download-") as folder:
                path = Path(folder, f"{key}.{suffix}")
                self._make(key, path)
                return _read(path.open("rb"))  # which stays readable without its name
        finally:
            self._free.release()

    def _make(self, key: str, path: Path) -> None:
        exported = path.suffix in (".h5", ".vtkhdf")
        made = ["export", key, str(path)] if exported else ["show", key, "--output", str(path)]
        command = [sys.executable, "-P", "-m", "api.worker.background", str(self._memory), *made]
        try:
            result = subprocess.run(
                [*command, "--store", str(self._store)],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=SECONDS,
                start_new_session=True,  # whose priority it lowers
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise NoFile(f"the file was not made within {SECONDS:g} s") from None
        if result.returncode != 0:
            said = result.stderr.strip().splitlines()[-1:] or ["it was ended"]
            if result.returncode == _REFUSED:
                raise BadInput(said[0])
            raise NoFile(f"the file could not be made: {said[0]}")


def _read(file: BinaryIO) -> Iterator[bytes]:
    with file:
        while piece := file.read(PIECE_BYTES):
            yield piece


def boundary_table(boundary: Boundary) -> str:
    """Write the points of a boundary as comma-separated values.

    Parameters
    ----------
    boundary : Boundary

    Returns
    -------
    str
        A line for each point; numbers have all their digits, and what is not known is empty.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        [
            *boundary.swept,
            f"critical {boundary.searched}",
            *("bracket low", "bracket high", "outcome below", "outcome above"),
            *("status", "certified", "runs"),
        ]
    )
    for point in sorted(boundary.points, key=boundary.place):
        writer.writerow(
            [
                *boundary.place(point),
                point.critical_value,
                *point.bracket,
                *point.outcomes,
                point.status,
                point.certified,
                " ".join(point.runs),
            ]
        )
    return text.getvalue()


def file_response(formats: Iterable[str]) -> dict[int | str, dict[str, Any]]:
    """Describe in OpenAPI an answer that is a file.

    Parameters
    ----------
    formats : iterable of str
        Suffixes that it may have.

    Returns
    -------
    dict
        For the argument `responses` of a route.
    """
    schema = {"schema": {"type": "string", "format": "binary"}}
    content = {MEDIA_TYPES[suffix]: schema for suffix in formats}
    return {HTTPStatus.OK.value: {"description": "The file.", "content": content}}
