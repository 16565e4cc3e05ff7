"""The versions of what results depend on."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import version

from ensemble.config.run_key import DISTRIBUTION

_PACKAGES = (DISTRIBUTION, "numpy", "scipy", "numba")


def result_versions() -> dict[str, str]:
    """Return the version of each package that numbers depend on, and of Python.

    Returns
    -------
    dict
    """
    return {package: _installed(package) for package in _PACKAGES} | {"python": platform.python_version()}


@cache  # what is looked up reads and parses a file
def _installed(package: str) -> str:
    return version(package)
