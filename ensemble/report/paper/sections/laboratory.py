"""The estimate with which the paper closes, in the units of a laboratory (Quaife et al. 2019, sec. VI)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import matplotlib
from matplotlib.figure import Figure

from ensemble.figures.style import BLUE, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.case import StudyCase
from ensemble.report.paper.comparison import (
    Comparison,
    Evidence,
    Interval,
    compare_intervals,
    compare_numbers,
    published,
    study_runs,
)
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from solver.dimensions import ADHESION_ENERGY, LENGTH, RATE
from solver.scene import Units

_MICRO = 1e-6
_SHOWN_RADII = (0.3e-6, 1e-6, 3e-6, 10e-6, 30e-6)  # meters


class ClosingEstimate(NamedTuple):
    """What the paper says of a pair, in SI units, and the viscosity of water, of which it does not speak.

    Attributes
    ----------
    rate, adhesion_energy, bending_modulus, viscosity : float
    """

    rate: float
    adhesion_energy: float
    bending_modulus: float
    viscosity: float

    def units(self, radius: float, bending_modulus: float | None = None) -> Units:
        """Return the units of scenes whose vesicles have this radius.

        Parameters
        ----------
        radius : float
            Meters.
        bending_modulus : float, optional
            Another one than the estimate's, joules.

        Returns
        -------
        Units
        """
        modulus = self.bending_modulus if bending_modulus is None else bending_modulus
        return Units(
            radius=f"{radius!r} m", bending_modulus=f"{modulus!r} J", viscosity=f"{self.viscosity!r} Pa*s"
        )

    def radius_of_rate(self, rate: float) -> float:
        """Return the radius with which a dimensionless rate is the estimate's rate, meters.

        Parameters
        ----------
        rate : float
            In units of κ/(μR³).

        Returns
        -------
        float
        """
        return math.cbrt(rate * self.bending_modulus / (self.viscosity * self.rate))

    def radius_of_energy(self, energy: float) -> float:
        """Return the radius with which a dimensionless energy per area is the estimate's, meters.

        Parameters
        ----------
        energy : float
            In units of κ/R².

        Returns
        -------
        float
        """
        return math.sqrt(energy * self.bending_modulus / self.adhesion_energy)


def compare_estimate(
    estimate: ClosingEstimate, bracket: Interval, energy: float, evidence: Evidence
) -> list[Comparison]:
    """Compare the numbers of the estimate with those that follow from a critical rate.

    Parameters
    ----------
    estimate : ClosingEstimate
    bracket : (float, float)
        Of the critical rate, dimensionless.
    energy : float
        Energy per area of flat membranes, dimensionless.
    evidence : Evidence
        For the bracket.

    Returns
    -------
    list of Comparison
    """
    return list(_rows(estimate, bracket, energy, evidence))


def _rows(
    estimate: ClosingEstimate, bracket: Interval, energy: float, evidence: Evidence
) -> Iterator[Comparison]:
    low, high = (estimate.radius_of_rate(rate) for rate in bracket)
    critical = math.sqrt(bracket[0] * bracket[1])
    by_rate = estimate.units(estimate.radius_of_rate(critical))
    yield compare_intervals(
        "radius R at which 0.5 1/s is the critical rate, µm",
        None,
        (low / _MICRO, high / _MICRO),
        evidence,
        note="“µm-sized”",
    )
    yield compare_numbers(
        "adhesion energy of H = 0.7 at this radius, µJ/m²",
        estimate.adhesion_energy / _MICRO,
        energy * by_rate.scale(ADHESION_ENERGY) / _MICRO,
        evidence,
    )
    yield compare_numbers(
        "adhesion distance 0.4 R at this radius, µm", None, 0.4 * by_rate.scale(LENGTH) / _MICRO, evidence
    )
    by_energy = estimate.units(estimate.radius_of_energy(energy))
    yield compare_numbers(
        "radius R at which H = 0.7 is 1 µJ/m², µm", None, by_energy.scale(LENGTH) / _MICRO, evidence
    )
    yield compare_numbers(
        "critical rate at this radius, 1/s", estimate.rate, critical * by_energy.scale(RATE), evidence
    )
    radius = critical / energy * estimate.adhesion_energy / (estimate.viscosity * estimate.rate)
    modulus = estimate.adhesion_energy * radius**2 / energy
    yield compare_numbers("radius R that makes both true, µm", None, radius / _MICRO, evidence)
    yield compare_numbers(
        "bending modulus that makes both true, J", estimate.bending_modulus, modulus, evidence
    )


def _generate(quick: bool) -> SectionGenerator:
    stated = published()["laboratory"]
    study = StudyCase.of(
        "critical-extension-rate",
        {"sweep.values": [stated["reduced_area"]]} | ({"search.tolerance": 0.03} if quick else {}),
    )
    results = yield SectionPlan(studies=[study])
    bracket = results.brackets(study).get(stated["reduced_area"])
    adhesion = study.study.scene.adhesion
    if bracket is None or adhesion is None:
        return SectionContent([_TEXT, "The critical rate has no bracket."])
    energy = stated["hamaker"] * adhesion.flat_membranes.energy
    estimate = ClosingEstimate(
        stated["rate"], stated["adhesion_energy"], stated["bending_modulus"], stated["viscosity"]
    )
    evidence = study_runs(study, results.points(study)[stated["reduced_area"]].runs)
    figure = _energy_against_rate(estimate, math.sqrt(bracket[0] * bracket[1]), energy)
    return SectionContent(
        [
            _TEXT,
            SectionFigure("energy-against-rate", _CAPTION, figure, study.command),
            compare_estimate(estimate, bracket, energy, evidence),
            _VERDICT,
        ]
    )


@matplotlib.rc_context(STYLE)
def _energy_against_rate(estimate: ClosingEstimate, critical: float, energy: float) -> Figure:
    """Draw what a pair of each radius would show, and what the paper says."""
    figure = Figure(figsize=(WIDTH / 2, 3.2), layout="constrained")
    axes = figure.add_subplot(
        xscale="log", yscale="log", xlabel="critical extension rate (1/s)", ylabel="adhesion energy (µJ/m²)"
    )
    units = [estimate.units(radius) for radius in _SHOWN_RADII]
    rates = [critical * each.scale(RATE) for each in units]
    energies = [energy * each.scale(ADHESION_ENERGY) / _MICRO for each in units]
    axes.plot(rates, energies, color=BLUE, marker="o")
    for radius, place in zip(_SHOWN_RADII, zip(rates, energies, strict=True), strict=True):
        axes.annotate(f"{radius / _MICRO:g} µm", place, (-6, 4), textcoords="offset points", ha="right")
    stated = (estimate.rate, estimate.adhesion_energy / _MICRO)
    axes.plot(*stated, color=VERMILLION, marker="x", linestyle="none")
    axes.annotate("the paper", stated, (6, 4), textcoords="offset points")
    axes.margins(0.15)
    return figure


_CAPTION = (
    "Critical extension rate and adhesion energy of pairs of H = 0.7 and reduced area 0.8 in water, by their "
    "radius; cross: the paper's estimate."
)


_TEXT = (
    "The paper closes with an estimate: a pair of “µm-sized” vesicles with a bending modulus of about "
    "10⁻¹⁹ J, reduced area 0.8 and H = 0.7, “which corresponds to” about 1 µJ/m², is expected to separate"
    " at an extension rate of 0.5 1/s.  With the viscosity of water, 1 mPa s, the critical rate gives the"
    " radius, as rates are in units of κ/(μR³); and the adhesion energy of flat membranes, 4.8368·Hδ, "
    "gives another one, as it is in units of κ/R²."
)
_VERDICT = (
    "The rate, the reduced area, H and the bending modulus fit together, at a radius of a few µm.  The "
    "energy does not: it is about 50 times too large.  It belongs to a radius below half a µm, whose "
    "pairs separate at a rate hundreds of times larger.  No bending modulus of a lipid membrane makes "
    "both true: the energy over viscosity and rate alone gives the radius."
)


SECTION = Section("laboratory", "The closing estimate, in the units of a laboratory", _generate)
