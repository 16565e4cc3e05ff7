"""Names of workers, by which others on the same machine can tell that one has died."""

from __future__ import annotations

import os
from pathlib import Path

BOOT = Path("/proc/sys/kernel/random/boot_id")
PROCESSES = Path("/proc/self/ns/pid")  # those of a container have numbers of their own
ENDED = ("Z", "X")  # nobody may have taken note of it yet


def own_name() -> str:
    """Name this process as no other is named, on any machine and at any time."""
    started = _started(os.getpid())
    assert started is not None, "this process runs"
    return f"{_place()} {os.getpid()} {started}"


def has_died(name: str) -> bool:
    """Tell whether a worker is known to have ended; one on another machine is not."""
    place, _, process = name.partition(" ")
    number, _, started = process.partition(" ")
    return place == _place() and _started(int(number)) != started


def _place() -> str:
    return f"{BOOT.read_text().strip()}/{PROCESSES.readlink()}"


def _started(number: int) -> str | None:
    """When a process has started, in ticks since boot; None if there is none, or it has ended."""
    try:
        text = Path(f"/proc/{number}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    state, *rest = text.rpartition(")")[2].split()  # its name, in parentheses, may hold anything
    return None if state in ENDED else rest[18]
