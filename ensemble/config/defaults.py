"""What is used when nothing else is said."""

from __future__ import annotations

from pathlib import Path
from typing import Final

DEFAULT_STORE: Final = Path("ensemble-store")
DEFAULT_STUDY: Final = "critical-hamaker"
LISTED: Final = 100  # records of a list unless its reader asks for more
