"""`python -m ensemble` and the command `ensemble` are the command line."""

from ensemble.interrupts import end_with_one_line


def main() -> None:
    """Run the command line; signals are provided for before anything else is imported."""
    end_with_one_line()
    from ensemble.cli import main as run

    run()


if __name__ == "__main__":
    main()
