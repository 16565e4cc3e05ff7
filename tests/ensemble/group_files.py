"""The files of a stored group: the archive of today, or the many files that earlier versions wrote."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from zipfile import ZipFile

from ensemble.store.zarr_groups import ARCHIVE


def unpack(directory: Path) -> Path:
    """Turn a run or a branch into what earlier versions wrote: a file for each chunk and each document."""
    with ZipFile(directory / ARCHIVE) as archive:
        archive.extractall(directory)
    (directory / ARCHIVE).unlink()
    return directory


def pack(directory: Path) -> None:
    """Undo `unpack`, whatever has become of the files."""
    files = sorted(path for path in directory.rglob("*") if path.is_file())
    with ZipFile(directory / ARCHIVE, "w") as archive:
        for file in files:
            archive.write(file, file.relative_to(directory))
    for entry in directory.iterdir():
        if entry.is_dir():
            shutil.rmtree(entry)
        elif entry.name != ARCHIVE:
            entry.unlink()


@contextmanager
def unpacked(directory: Path) -> Iterator[Path]:
    """Change the files of a group within its archive."""
    yield unpack(directory)
    pack(directory)
