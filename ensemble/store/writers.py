"""The directories of processes that write to a store.

Each has one of its own in `staging/`, with a name that no other one has, and holds its lock while it lives.
"""

from __future__ import annotations

import fcntl
import os
import re
from collections.abc import Iterator
from pathlib import Path

STAGING = "staging"
WRITER_LOCK = "writer.lock"

DIGITS = 32  # hexadecimal ones, of the names of most directories that a store makes


def is_own_directory(path: Path, digits: int = DIGITS) -> bool:
    """Tell whether a path is a directory with a name as the store gives it: hexadecimal digits.

    Parameters
    ----------
    path : Path
        An entry of a directory of a store.  Links do not count.
    digits : int
        How many there are.

    Returns
    -------
    bool
    """
    return is_own_name(path.name, digits) and path.is_dir() and not path.is_symlink()


def is_own_name(name: str, digits: int = DIGITS) -> bool:
    """Tell whether a name is of the form that the store gives: hexadecimal digits.

    Parameters
    ----------
    name : str
    digits : int
        How many there are.

    Returns
    -------
    bool
    """
    return re.fullmatch(rf"[0-9a-f]{{{digits}}}", name) is not None


def abandoned(staging: Path) -> Iterator[Path]:
    """Find the directories of writers that no longer live.

    Parameters
    ----------
    staging : Path
        The directory `staging/` of a store, whose lock the caller holds.

    Returns
    -------
    iterator of Path
        Directories that writers made.  Everything else in `staging/` is left alone.
    """
    return (
        entry
        for entry in staging.iterdir()
        if is_own_directory(entry) and (entry / WRITER_LOCK).exists() and not lives(entry)
    )


def lives(directory: Path) -> bool:
    """Tell whether the process that made a directory in `staging/` may live.

    Parameters
    ----------
    directory : Path
        It need not exist any more.

    Returns
    -------
    bool
        True also if its lock belongs to somebody else and cannot be looked at.
    """
    try:
        descriptor = os.open(directory / WRITER_LOCK, os.O_RDWR)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False
