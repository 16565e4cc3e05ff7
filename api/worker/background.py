"""The command line at low priority, in so many bytes: ``python -m api.worker.background BYTES ARGUMENTS...``.

Every rank of a job runs in this way, so that the service answers while a job computes.  A job takes what is
left of the machine; competing with a server, a shell or other programs it takes a third of their share.

What needs more memory than it may have is refused it and says so, before the machine runs out of it and kills
whatever is largest.
"""

from __future__ import annotations

import os
import resource
import sys
from contextlib import suppress
from pathlib import Path

from tenacity import retry, retry_if_exception_type, stop_after_delay, wait_random

NICENESS = 5  # a third of the weight of a process with none
AUTOGROUP = Path("/proc/self/autogroup")


def main() -> None:
    """Lower the priority of this process and its session, limit its memory, and run the command line."""
    os.nice(NICENESS)
    # Linux weighs sessions against each other, and launchers give each rank a session of its own.  Between
    # sessions the niceness of a process means nothing.  Not every kernel weighs sessions.
    with suppress(OSError):
        _weigh_session()
    limit = int(sys.argv.pop(1))
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))  # private memory; not what MPI shares, nor files
    from ensemble.__main__ import main as run

    sys.argv[0] = "ensemble"
    run()


# The kernel accepts few such changes at a time; the others have to try again.
@retry(
    retry=retry_if_exception_type(BlockingIOError),
    wait=wait_random(0.1, 0.3),
    stop=stop_after_delay(2.0),
    reraise=True,
)
def _weigh_session() -> None:
    AUTOGROUP.write_text(str(NICENESS))


if __name__ == "__main__":
    main()
