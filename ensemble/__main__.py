"""`python -m ensemble` is the command line."""

from ensemble.cli import main

main()
