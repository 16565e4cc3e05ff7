"""The sections of the report, in their order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ensemble.report.paper import (
    contrast,
    critical_hamaker,
    doublets,
    draining,
    exponents,
    extension,
    shear,
    trap,
    unequal,
    viscosity,
)
from ensemble.report.paper.section import Section

SECTIONS: Final[tuple[Section, ...]] = (
    draining.SECTION,
    doublets.SECTION,
    extension.SECTION,
    trap.SECTION,
    shear.SECTION,
    critical_hamaker.SECTION,
    viscosity.SECTION,
    exponents.SECTION,
    unequal.SECTION,
    contrast.SECTION,
)


def chosen(names: Sequence[str]) -> tuple[Section, ...]:
    """Return the sections with these names, in the order of the report; all of them if there are no names.

    Raises
    ------
    ValueError
        If there is no section of one of the names.
    """
    known = [section.name for section in SECTIONS]
    for name in names:
        if name not in known:
            raise ValueError(f"--only: {name!r} is not a section; sections: {', '.join(known)}")
    return tuple(section for section in SECTIONS if not names or section.name in names)
