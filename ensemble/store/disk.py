"""What makes files outlive a power failure, and processes keep out of each other's way."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def flush(path: Path) -> None:
    """Make a file's contents, or a directory's entries, durable (fsync)."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_tree(root: Path) -> None:
    """Make a directory and everything below it durable."""
    for directory, _, names in os.walk(root, topdown=False):
        for name in names:
            flush(Path(directory, name))
        flush(Path(directory))


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold an exclusive lock, against threads as well as processes; it ends with its holder's life."""
    # flock belongs to the open file, so each holder opens its own.
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
