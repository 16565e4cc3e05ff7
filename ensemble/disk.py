"""Files that outlive a power failure or appear complete or not at all, and locks between processes."""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from socket import gethostname
from tempfile import TemporaryDirectory, TemporaryFile
from uuid import uuid4

PROBE_BYTES = 1 << 17

# What file systems answer that do not flush directories (some network and user-space ones): their entries
# are then as durable as the file system makes them.
_NO_DIRECTORY_FLUSH = {errno.EINVAL, errno.ENOTSUP, errno.EBADF}


def flush(path: Path) -> None:
    """Make the contents of a file, or the entries of a directory, durable (fsync).

    Parameters
    ----------
    path : Path
        The file or directory.  A file system that refuses to flush directories is accepted.
    """
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_DIRECTORY_FLUSH or not path.is_dir():
            raise
    finally:
        os.close(descriptor)


def flush_tree(root: Path) -> None:
    """Make a directory and everything below it durable.

    Parameters
    ----------
    root : Path
        The directory.
    """
    for directory, _, names in os.walk(root, topdown=False):
        for name in names:
            flush(Path(directory, name))
        flush(Path(directory))


def require_space(directory: Path) -> None:
    """Raise an error unless a directory takes a file of the size that a short run needs.

    Parameters
    ----------
    directory : Path
        It holds no more than before when this returns.

    Raises
    ------
    OSError
        If the disk or the user's part of it is full, or the directory cannot be written to.
    """
    with TemporaryFile(dir=directory) as file:
        file.write(bytes(PROBE_BYTES))


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold an exclusive lock against other threads and processes; it ends when its holder dies.

    Parameters
    ----------
    path : Path
        The lock file.  It is created if it does not exist, with the permissions that the umask leaves, so
        that a group that shares a directory shares its locks.
    """
    # flock belongs to the open file, so each holder opens its own.
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def placing(path: Path, directory: Path) -> Iterator[Path]:
    """Yield a file to write, which is made durable and put in its place when the block ends without an error.

    Parameters
    ----------
    path : Path
        The place: a new file, or one that is replaced.
    directory : Path
        Where the file is written, on the same file system.

    Yields
    ------
    Path
        A file of the same name.

    Raises
    ------
    OSError
        If the disk does not take it; then a file that is in the place stays.
    """
    unfinished = directory / path.name
    try:
        yield unfinished
        flush(unfinished)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)  # its space may be what lacks


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a file to write, which takes the place of ``path`` when the block ends without an error.

    The target of a link is replaced, and the link stays.  A pipe or a device is written to.

    Parameters
    ----------
    path : Path
        The file to create or replace.  Its directory exists.

    Yields
    ------
    Path
        A hidden file with the same suffix, for a file in the same directory.  A killed process leaves it
        behind, and whoever writes to ``path`` next removes it.

    Raises
    ------
    OSError
        If ``path`` is a directory, or cannot be written.
    """
    target = path.resolve()
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, f"{path} is a directory")
    if target.exists() and not target.is_file():
        with TemporaryDirectory() as directory:
            unfinished = Path(directory, f"output{path.suffix}")
            yield unfinished
            with unfinished.open("rb") as source, target.open("wb") as sink:
                shutil.copyfileobj(source, sink)
        return
    mine = f".unfinished-{_digest(target.name)}-{_digest(gethostname())}-"
    for left in target.parent.glob(f"{mine}*"):
        if not _is_alive(left.name.removeprefix(mine).partition("-")[0]):
            left.unlink(missing_ok=True)
    unfinished = target.with_name(f"{mine}{os.getpid()}-{uuid4().hex[:8]}{path.suffix}")
    try:
        yield unfinished
        unfinished.replace(target)
    finally:
        unfinished.unlink(missing_ok=True)


def write_durably(path: Path, contents: bytes | memoryview) -> None:
    """Write a file, or replace it in one step; it is durable when this returns.

    Parameters
    ----------
    path : Path
        See `replacing`.
    contents : bytes-like

    Raises
    ------
    OSError
        If it cannot be written.  An earlier file is then unchanged.
    """
    with replacing(path) as unfinished:
        unfinished.write_bytes(contents)
        flush(unfinished)
    flush(path.parent)


def _digest(name: str) -> str:
    return sha256(os.fsencode(name)).hexdigest()[:8]


def _is_alive(process: str) -> bool:
    try:
        os.kill(int(process), 0)
    except (ValueError, PermissionError):  # not a name that `replacing` gives, or of somebody else
        return True
    except ProcessLookupError:
        return False
    return True
