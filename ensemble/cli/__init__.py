"""The command line."""

from ensemble.cli.main import main

__all__ = ["main"]
