"""Identities of workers, by which others on the same machine can tell that one has died."""

from __future__ import annotations

import os
from pathlib import Path

BOOT = Path("/proc/sys/kernel/random/boot_id")
PROCESS_NAMESPACE = Path("/proc/self/ns/pid")  # a container numbers its processes by itself
ENDED = ("Z", "X")  # states of a process that has ended, also if its parent has not noticed yet


def own_identity() -> str:
    """Return the identity of this process, which no other has, on any machine and at any time."""
    started = _started(os.getpid())
    assert started is not None, "this process runs"
    return f"{_place()} {os.getpid()} {started}"


def has_died(identity: str) -> bool:
    """Return whether a worker is known to have ended.

    Parameters
    ----------
    identity : str
        Of the worker.

    Returns
    -------
    bool
        False for a worker on another machine, of which nothing is known.
    """
    place, _, process = identity.partition(" ")
    number, _, started = process.partition(" ")
    return place == _place() and _started(int(number)) != started


def _place() -> str:
    return f"{BOOT.read_text().strip()}/{PROCESS_NAMESPACE.readlink()}"


def _started(number: int) -> str | None:
    """When a process has started, in ticks since boot; None if there is none, or it has ended."""
    try:
        text = Path(f"/proc/{number}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    state, *rest = text.rpartition(")")[2].split()  # the name, in parentheses, may hold anything
    return None if state in ENDED else rest[18]
