"""`python -m ensemble` and the command `ensemble` are the command line."""

import sys

from ensemble.errors import Interrupted
from ensemble.interrupts import end_with_launcher, end_with_one_line, let_answer_stand
from ensemble.mpi.world import fail_with_others


def main() -> None:
    """Run the command line; signals are provided for before anything else is imported."""
    end_with_one_line()
    end_with_launcher()
    status: str | int | None = None
    try:
        from ensemble.cli import main as run

        run()
    except BaseException as error:
        status = _status(error)
    let_answer_stand()
    sys.exit(status)


def _status(error: BaseException) -> str | int | None:
    """Return the status with which an exception ends this process, and say what must be said."""
    if Interrupted.latest is not None:  # whatever has become of it on its way here
        return Interrupted.latest.status
    if not isinstance(error, SystemExit):
        sys.excepthook(type(error), error, error.__traceback__)
    status = error.code if isinstance(error, SystemExit) else 1
    if status not in (None, 0):
        fail_with_others()
    return status


if __name__ == "__main__":
    main()
