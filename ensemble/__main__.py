"""`python -m ensemble` and the command `ensemble` are the command line."""

import sys
import traceback

from ensemble.errors import Interrupted
from ensemble.interrupts import end_with_launcher, end_with_one_line
from ensemble.mpi.world import fail_with_others


def main() -> None:
    """Run the command line; signals are provided for before anything else is imported."""
    end_with_one_line()
    end_with_launcher()
    try:
        from ensemble.cli import main as run

        run()
    except Interrupted as interruption:
        sys.exit(interruption.status)
    except SystemExit as end:
        if end.code not in (None, 0):
            fail_with_others()
        raise
    except BaseException:
        traceback.print_exc()
        fail_with_others()
        sys.exit(1)


if __name__ == "__main__":
    main()
