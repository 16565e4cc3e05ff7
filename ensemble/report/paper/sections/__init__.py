"""The sections of the report on the paper, in their order; one module each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ensemble.report.paper.section import Section
from ensemble.report.paper.sections import (
    critical_hamaker,
    dilute_viscosity,
    draining,
    equilibrium_doublets,
    extensional_pairs,
    laboratory,
    potential_exponents,
    sheared_doublets,
    steady_limits,
    trapped_doublets,
    unequal_vesicles,
    viscosity_contrasts,
)

SECTIONS: Final[tuple[Section, ...]] = (
    draining.SECTION,
    equilibrium_doublets.SECTION,
    extensional_pairs.SECTION,
    trapped_doublets.SECTION,
    laboratory.SECTION,
    sheared_doublets.SECTION,
    critical_hamaker.SECTION,
    dilute_viscosity.SECTION,
    potential_exponents.SECTION,
    unequal_vesicles.SECTION,
    viscosity_contrasts.SECTION,
    steady_limits.SECTION,
)


def sections_named(names: Sequence[str]) -> tuple[Section, ...]:
    """Return the sections with these names, in the order of the report.

    Parameters
    ----------
    names : sequence of str
        Names of sections; if there are none, all sections are returned.

    Returns
    -------
    tuple of Section
        The sections.

    Raises
    ------
    ValueError
        If no section has one of the names.
    """
    known = [section.name for section in SECTIONS]
    for name in names:
        if name not in known:
            raise ValueError(f"--only: {name!r} is not a section; sections: {', '.join(known)}")
    return tuple(section for section in SECTIONS if not names or section.name in names)
