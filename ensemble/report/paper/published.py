"""What the paper and independent codes have published."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def published() -> dict[str, Any]:
    """Return the tables of ``published.toml``, which states their source."""
    data = files("ensemble.report.paper") / "published.toml"
    return tomllib.loads(data.read_text(encoding="utf-8"))
