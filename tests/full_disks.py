"""Small disks that tests fill, where the tests may mount one."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

ROOM = "size=6m"
ENTRIES = "size=6m,nr_inodes=300"
MANY_ENTRIES = 10_000


@contextmanager
def small_disk(place: Path, option: str) -> Iterator[Path]:
    """Mount a file system in memory with little room, or with room for few files."""
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", option, "tmpfs", place], capture_output=True, text=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip(f"mounting is not permitted: {mounted.stderr.strip()}")
    try:
        yield place
    finally:
        subprocess.run(["umount", "--lazy", place], check=True)


@contextmanager
def filled(disk: Path) -> Iterator[None]:
    """Fill a disk for a while: its bytes, and its entries if there are few."""
    few = os.statvfs(disk).f_files < MANY_ENTRIES
    fillers = [disk / "filler"]
    try:
        with fillers[0].open("wb") as file:
            for size in (1 << 16, 1 << 12, 1):
                _write_until_full(file.fileno(), size)
        with suppress(OSError):
            while few:
                filler = disk / f"filler-{len(fillers)}"
                filler.touch()
                fillers.append(filler)
        yield
    finally:
        for filler in fillers:
            filler.unlink()


def _write_until_full(descriptor: int, size: int) -> None:
    try:
        while True:
            os.write(descriptor, bytes(size))
    except OSError:
        return
