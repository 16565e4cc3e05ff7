"""Doublets at equilibrium: their shapes, the contact region, and their energies (paper, section III.B)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from ensemble.report.paper import doublet_figures
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Row, number, words
from ensemble.report.paper.contact import Contact, contact_of
from ensemble.report.paper.power_laws import power_law
from ensemble.report.paper.published import published
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan

_HAMAKER, _DISTANCE = 5.0, 0.2  # those of the published doublets
_SHOWN = (0.6, 0.75, 0.95)  # reduced areas of the published shapes
_REDUCED_AREAS = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 0.98, 0.99)
_DISTANCES = (0.2, 0.3, 0.4)
_HAMAKERS = (1.0, 2.0, 3.0, 4.0, 5.0)
_STRENGTHS = (3.0, 4.0, 5.0, 6.5)  # for which the reduced area of least energy is looked for
_AREA_OF_HAMAKERS = 0.95


class Energies(NamedTuple):
    """Energies of a doublet where the abscissa (reduced area or Hamaker constant) has this value.

    bending : of both vesicles together, that is ∫curvature² ds of one of modulus 1.
    """

    at: float
    bending: float
    adhesion: float

    @property
    def total(self) -> float:
        """The sum."""
        return self.bending + self.adhesion


def least_energy(energies: Sequence[Energies]) -> float | None:
    """Where the total energy is smallest, on a cubic spline; None if that is at an end."""
    at = [point.at for point in energies]
    total = CubicSpline(at, [point.total for point in energies])
    found = minimize_scalar(total, bounds=(at[0], at[-1]), method="bounded", options={"xatol": 1e-6})
    inside = at[0] + 1e-3 < found.x < at[-1] - 1e-3
    return float(found.x) if inside else None


def _doublet(reduced_area: float, hamaker: float = _HAMAKER, distance: float = _DISTANCE) -> Case:
    return Case.of(
        "doublet-equilibrium",
        {
            "vesicles.reduced_area": reduced_area,
            "adhesion.hamaker": hamaker,
            "adhesion.distance": distance,
        },
    )


def _course(quick: bool) -> Course:
    areas = _REDUCED_AREAS[3:8] if quick else _REDUCED_AREAS
    strengths = (_HAMAKER,) if quick else _STRENGTHS
    distances, hamakers = (_DISTANCES[:1], _HAMAKERS[::2]) if quick else (_DISTANCES, _HAMAKERS)
    shapes = [_doublet(area) for area in _SHOWN]
    settings = [_doublet(area) for area, _, _ in published()["doublets"]["energies"]]
    by_area = {strength: {area: _doublet(area, strength) for area in areas} for strength in strengths}
    by_hamaker = {
        distance: {hamaker: _doublet(_AREA_OF_HAMAKERS, hamaker, distance) for hamaker in hamakers}
        for distance in distances
    }
    swept = [case for cases in (*by_area.values(), *by_hamaker.values()) for case in cases.values()]
    results = yield SectionPlan([*shapes, *settings, *swept])

    runs = {case: results.run(case) for case in shapes if not results.failed(case)}
    contacts = {case: contact_of(run) for case, run in runs.items()}
    areas_shown = {case.scene.vesicles[0].reduced_area: contact for case, contact in contacts.items()}
    of_area = {strength: _energies(results, cases) for strength, cases in by_area.items()}
    of_hamaker = {distance: _energies(results, cases) for distance, cases in by_hamaker.items()}
    best = {strength: least_energy(energies) for strength, energies in of_area.items()}
    return Chapter(
        [
            _SHAPES_TEXT,
            Drawing("shapes", _SHAPES_CAPTION, doublet_figures.shapes(list(runs.values()))),
            Drawing("contact", _CONTACT_CAPTION, doublet_figures.contacts(areas_shown, _DISTANCE)),
            [row for case, contact in contacts.items() for row in _contact_rows(case, contact)],
            _AREA_TEXT,
            Drawing("reduced-area", _AREA_CAPTION, doublet_figures.against_area(of_area, best)),
            [*_energy_rows(results, settings), *_best_rows(best, by_area)],
            _HAMAKER_TEXT,
            Drawing("hamaker", _HAMAKER_CAPTION, doublet_figures.against_hamaker(of_hamaker)),
            _linearity_rows(of_hamaker, by_hamaker),
        ]
    )


def _energies(results: Results, cases: Mapping[float, Case]) -> list[Energies]:
    """Energies of the runs that did not fail, ascending."""
    found = []
    for at, case in sorted(cases.items()):
        energy = results.summary(case).energy
        if not results.failed(case) and energy.adhesion is not None:
            found.append(Energies(at, energy.bending, energy.adhesion))
    return found


_SHAPES_TEXT = (
    "Two vesicles brought together at rest flatten each other.  A positive pull is attraction.  The "
    "*edge* of the contact region is where the gap is smallest; the *dip* is by how much it is smaller "
    "there than on the line of centers.  The paper finds attraction in the contact region for the "
    "deflated vesicles, except at the edge, and repulsion for those of reduced area 0.95."
)
_SHAPES_CAPTION = (
    "Doublets at equilibrium, H = 5, δ = 0.2; color: tension, on one scale.  The contact region is "
    "compressed."
)
_CONTACT_CAPTION = (
    "The contact region (not to scale): half the gap against the distance from the line of centers; "
    "color: adhesive force toward the other vesicle, negative where it repels."
)
_AREA_TEXT = (
    "Published are energies at the actual reduced areas 0.591, 0.797 and 0.948; the bending energy is "
    "that of both vesicles, or ∫κ² ds of one.  Past the paper: the reduced area at which the sum is "
    "smallest, for weaker and stronger adhesion.  Vesicles that could choose their area would take it."
)
_AREA_CAPTION = (
    "Left: bending (solid) and adhesion (dash-dotted) energy against reduced area, H = 5; diamonds: "
    "published.  Right: their sum, less its smallest value, for several H; dotted lines mark the minimum."
)
_HAMAKER_TEXT = (
    "At reduced area 0.95 the paper finds that the shape, hence the bending energy, hardly changes with "
    "H, and that the adhesion energy is linear in it.  An exponent of 1 is exact linearity."
)
_HAMAKER_CAPTION = (
    "Bending and adhesion energy of doublets of reduced area 0.95 against the Hamaker constant."
)


def _contact_rows(case: Case, contact: Contact) -> list[Row]:
    area = case.scene.vesicles[0].reduced_area
    values = published()["doublets"]
    inside = dict.fromkeys(values["attracted_inside"], "attracts")
    inside |= dict.fromkeys(values["repelled_inside"], "repels")
    return [
        words(f"force in the middle, ΔA = {area:g}", inside[area], _sign(contact.pull_in_middle), [case]),
        words(f"force at the edge, ΔA = {area:g}", "repels", _sign(contact.pull_at_edge), [case]),
        number(f"gap in the middle / δ, ΔA = {area:g}", None, contact.middle_gap / _DISTANCE, [case]),
        number(f"gap at the edge / δ, ΔA = {area:g}", None, contact.gap.min() / _DISTANCE, [case]),
        number(f"dip at the edge, ΔA = {area:g}", None, contact.dip, [case]),
    ]


def _sign(pull: float) -> str:
    return "attracts" if pull > 0 else "repels"


def _energy_rows(results: Results, settings: Sequence[Case]) -> list[Row]:
    rows = []
    for case, (area, bending, adhesion) in zip(settings, published()["doublets"]["energies"], strict=True):
        energy = results.summary(case).energy
        rows += [
            number(f"bending energy, ΔA = {area:g}", bending, energy.bending, [case], allowed=1),
            number(f"adhesion energy, ΔA = {area:g}", adhesion, energy.adhesion, [case], allowed=1),
        ]
    return rows


def _best_rows(
    best: Mapping[float, float | None], by_area: Mapping[float, Mapping[float, Case]]
) -> list[Row]:
    known = published()["doublets"]["minimum_of_total_energy"]
    return [
        number(
            f"reduced area of least total energy, H = {strength:g}",
            known if strength == _HAMAKER else None,
            found,
            allowed=2 if strength == _HAMAKER else None,
            runs=[case.key for case in by_area[strength].values()],
            note="" if found is not None else "at an end of the range",
        )
        for strength, found in best.items()
    ]


def _linearity_rows(
    of_hamaker: Mapping[float, Sequence[Energies]], by_hamaker: Mapping[float, Mapping[float, Case]]
) -> list[Row]:
    rows = []
    for distance, energies in of_hamaker.items():
        if len(energies) < 3:
            continue
        at = [point.at for point in energies]
        law = power_law(at, [-point.adhesion for point in energies])
        change = 100 * (energies[-1].bending / energies[0].bending - 1)
        keys = [case.key for case in by_hamaker[distance].values()]
        rows += [
            number(f"exponent of E_adh in H, δ = {distance:g}", 1.0, law.exponent, runs=keys, note=f"{law}"),
            number(f"change of E_bend over these H (%), δ = {distance:g}", None, change, runs=keys),
        ]
    return rows


SECTION = Section("doublets", "Doublets at equilibrium", _course)
