"""The command line at low priority: ``python -m api.worker.background ARGUMENTS...``.

Every rank of a job runs so.  A service then answers while it computes: a job has all that is left of the
machine, and beside a server, a shell, or whatever else its users do there it takes a third of their share.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from tenacity import retry, retry_if_exception_type, stop_after_delay, wait_random

NICENESS = 5  # a third of the weight of what has none
AUTOGROUP = Path("/proc/self/autogroup")


def main() -> None:
    """Give way, and do what the command line does."""
    os.nice(NICENESS)
    # Linux weighs sessions against each other, and launchers give each rank one of its own: between these
    # the niceness of a process means nothing.  Not every kernel does so.
    with suppress(OSError):
        _weigh_session()
    from ensemble.cli.main import main as run

    sys.argv[0] = "ensemble"
    run()


# The kernel takes few such changes at a time, and has the ranks of a job ask again.
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
