"""How a command ends when a signal stops it.

One that makes runs for a store keeps them after their next steps and ends with `SUSPENDED_STATUS`.  Every
other one, and this one at the second signal, ends at once with the status 128 and the signal's number.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import sys
import threading
import time
from types import FrameType

from ensemble.errors import Interrupted
from ensemble.mpi.end_requests import EndRequests
from ensemble.mpi.world import has_joined, is_launched, launched_rank, launched_size, tell

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
UNWINDING_SECONDS = 1.0
PARENT_CHECK_SECONDS = 0.2
LAUNCHER_CONNECTION = "PMI_FD"  # number of the open socket to the launcher's helper, where there is one
HYDRA = "HYDI_CONTROL_FD"  # set by the launcher of MPICH
PR_SET_PDEATHSIG = 1
STANDARD_ERROR = 2
SHOW_CURSOR = "\x1b[?25h"  # a progress display hides it


def end_with_one_line() -> None:
    """Make signals end this process: a run in progress after its next step, everything else at once.

    At once means within two seconds.  Alone, the process unwinds: `Interrupted` is raised, and what it was
    writing is removed.  If a thread keeps it, or a library swallows the exception, it is ended after
    `UNWINDING_SECONDS`.  What libraries print on the way is not shown.

    Under an MPI launcher the main thread may be inside a collective that never returns, because another rank
    has ended already.  So there another thread ends the process at once.  Nothing is lost by that: a run
    exists once it is committed; what is not committed is adopted or removed when the store is opened next.
    """
    if launched_size() == 1:
        for number in SIGNALS:
            signal.signal(number, _interrupt)
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    # Written to by the signal itself, whatever Python is doing at the time.
    signal.set_wakeup_fd(writer)
    threading.Thread(target=_end, args=(reader,), name="signals", daemon=True).start()


def let_answer_stand() -> None:
    """Ignore signals from now on: the work of this process is done and its answer is given.

    The interpreter and MPI still have to end; a signal meanwhile would turn success into a failure.  A rank
    that waits there for one that has died is killed by the launcher.
    """
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def end_with_launcher() -> None:
    """Let this process end when the one that launched it does, if it has been launched.

    An MPI launcher that is killed takes its ranks along, but its helper on each node does not: ranks that
    lost it would simulate on, unrecorded.  A new parent is the sign.  A helper that died before this call is
    known by the connection that it left.  While MPI starts, no thread of Python can look: then the kernel
    ends the process.
    """
    if not is_launched():
        return
    parent = os.getppid()
    if HYDRA in os.environ:  # it never ends the thread that starts ranks, of which the kernel takes note
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if _is_cut_off():
        os._exit(1)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def _is_cut_off() -> bool:
    """Whether the launcher's helper has closed its end of the connection.  To be asked before MPI uses it."""
    if LAUNCHER_CONNECTION not in os.environ:
        return False
    connection = select.poll()
    connection.register(int(os.environ[LAUNCHER_CONNECTION]), 0)
    return any(event & select.POLLHUP for _, event in connection.poll(0))


def _interrupt(number: int, _: FrameType | None) -> None:
    if not EndRequests.ask():
        _unwind(128 + number)


def _unwind(status: int) -> None:
    interruption = Interrupted(status)
    for again in SIGNALS:  # a second signal ends the process at once
        signal.signal(again, lambda *_: os._exit(interruption.status))
    _say_interrupted()
    # Whatever comes of it, in a destructor or in a library, is no error to be shown.
    os.dup2(os.open(os.devnull, os.O_WRONLY), STANDARD_ERROR)
    watchdog = threading.Timer(UNWINDING_SECONDS, os._exit, (interruption.status,))
    watchdog.daemon = True
    watchdog.start()
    raise interruption


def _end(reader: int) -> None:
    (number,) = os.read(reader, 1)
    while EndRequests.ask():
        (number,) = os.read(reader, 1)
    _say_interrupted()
    if not has_joined():
        # The other ranks would wait for this one, and the launcher ends them only if a signal has ended it.
        os.kill(os.getpid(), signal.SIGKILL)
    os._exit(128 + number)


def _say_interrupted() -> None:
    """Print on the first rank what an interruption leaves."""
    # The stream of the process: the command line may have put another one in its place.
    stream = sys.__stderr__
    if launched_rank() == 0 and stream is not None:
        print(SHOW_CURSOR if stream.isatty() else "", file=stream, end="")
        tell("interrupted; what is in the store is kept, and the same command goes on from there")
