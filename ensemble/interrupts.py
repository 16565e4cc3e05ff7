"""How a command ends when a signal stops it: one line, and status 128 and the signal's number."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

from ensemble.errors import Interrupted
from ensemble.mpi.world import launched_rank, launched_size

SIGNALS = (signal.SIGINT, signal.SIGTERM)
UNWINDING_SECONDS = 1.0


def end_with_one_line() -> None:
    """Make SIGINT and SIGTERM end this process within two seconds, whatever it is doing.

    Alone, the process unwinds: `Interrupted` is raised, and what it was writing is removed.  If a thread
    keeps it, it is ended after `UNWINDING_SECONDS`.  Under an MPI launcher the main thread may be inside a
    collective that never returns, because another rank has ended already.  So there another thread ends the
    process at once.  Nothing is lost by that: a run exists once it is committed, and what is not committed is
    adopted or removed when the store is opened next.
    """
    if launched_size() == 1:
        for number in SIGNALS:
            signal.signal(number, _unwind)
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    # Written to by the signal itself, whatever Python is doing at the time.
    signal.set_wakeup_fd(writer)
    threading.Thread(target=_end, args=(reader,), name="signals", daemon=True).start()


def _unwind(number: int, _: FrameType | None) -> None:
    interruption = Interrupted(number)
    for again in SIGNALS:  # a second signal ends the process at once
        signal.signal(again, lambda *_: os._exit(interruption.status))
    _say_interrupted()
    watchdog = threading.Timer(UNWINDING_SECONDS, os._exit, (interruption.status,))
    watchdog.daemon = True
    watchdog.start()
    raise interruption


def _end(reader: int) -> None:
    (number,) = os.read(reader, 1)
    _say_interrupted()
    os._exit(Interrupted(number).status)


def _say_interrupted() -> None:
    """Print on the first rank what an interruption leaves."""
    if launched_rank() == 0:
        # The stream of the process: the command line may have put another one in its place.
        print(
            "ensemble: interrupted; finished runs are kept and the same command goes on",
            file=sys.__stderr__,
            flush=True,
        )
