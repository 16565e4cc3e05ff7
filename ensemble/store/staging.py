"""Where runs are written before they are committed: a directory for each writer, its own while it lives."""

from __future__ import annotations

import fcntl
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

from ensemble.disk import locked

LOCK = "writer.lock"


class Writer:
    """A directory in `staging` that holds its lock, and so is not swept, until closed or killed.

    The directory is made by the first call of `place`, so readers leave no trace.
    """

    def __init__(self, staging: Path, store_lock: Path) -> None:
        self._directory = staging / uuid4().hex
        self._store_lock = store_lock
        self._descriptor: int | None = None
        self._guard = threading.Lock()

    def place(self) -> Path:
        """Name a new directory to write a run to."""
        with self._guard:
            if self._descriptor is None:
                self._descriptor = self._register()
        return self._directory / uuid4().hex

    def _register(self) -> int:
        # Under the store's lock no sweeper meets the directory before its lock is taken.
        with locked(self._store_lock):
            self._directory.mkdir()
            descriptor = os.open(self._directory / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        return descriptor

    def close(self) -> None:
        """Remove the directory with whatever was not committed."""
        with self._guard:
            if self._descriptor is not None:
                shutil.rmtree(self._directory, ignore_errors=True)
                os.close(self._descriptor)
                self._descriptor = None


def _abandoned(directory: Path) -> bool:
    try:
        descriptor = os.open(directory / LOCK, os.O_RDWR)
    except (FileNotFoundError, NotADirectoryError):
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


def abandoned(staging: Path) -> Iterator[Path]:
    """Directories whose writer no longer lives.  The caller holds the store's lock."""
    return (entry for entry in staging.iterdir() if _abandoned(entry))
