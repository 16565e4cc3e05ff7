"""Runs a command, and ends all of its descendants as soon as the command or its worker has ended.

    python -m api.worker.watcher COMMAND...

MPI launchers put their helpers and ranks into sessions of their own, so neither a signal to a group nor the
end of the launcher reaches all of them.  This process stands between a worker and a launcher.  It adopts
descendants that lose their parents, and kills until none is left.  The end of its standard input tells it
that the worker is gone.  It passes SIGTERM on to the launcher.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress

import psutil

PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36


def main() -> None:
    """Run the command of the arguments and exit with its status, 128 and the signal if one ended it."""
    _control_process(PR_SET_CHILD_SUBREAPER, 1)
    signal.signal(signal.SIGTERM, lambda *_: None)  # not to end while the launcher starts
    launcher = _start(sys.argv[1:])
    signal.signal(signal.SIGTERM, lambda *_: launcher.send_signal(signal.SIGTERM))
    threading.Thread(target=_end_with_worker, name="worker-watch", daemon=True).start()
    status = launcher.wait()
    _kill_everything()
    sys.exit(status if status >= 0 else 128 - status)


def _start(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        # If this process itself is killed, the launcher is too, and takes its ranks along.
        preexec_fn=lambda: _control_process(PR_SET_PDEATHSIG, signal.SIGKILL),
    )


def _control_process(option: int, value: int) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(option, value, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl")


def _end_with_worker() -> None:
    os.read(sys.stdin.fileno(), 1)
    _kill_everything()
    os._exit(1)


def _kill_everything() -> None:
    """Kill all descendants, also those that appear meanwhile, and reap them."""
    while descendants := psutil.Process().children(recursive=True):
        for process in descendants:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        with suppress(ChildProcessError):
            os.wait()


if __name__ == "__main__":
    main()
