"""Shapes, contacts and energies of doublets at equilibrium (Quaife et al. 2019, sec. III.B, figs. 3 to 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import (
    Comparison,
    Evidence,
    compare_numbers,
    compare_words,
    published,
    runs_of,
)
from ensemble.report.paper.least_squares import power_law
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections import equilibrium_figures
from ensemble.report.paper.sections.contact_region import ContactRegion, contact_region
from ensemble.report.paper.sections.equilibrium_energies import (
    DoubletEnergy,
    doublet_energies,
    least_energy_parameter,
)

_HAMAKER, _DISTANCE = 5.0, 0.2  # of the published doublets (figs. 3 and 4)
_SHOWN_AREAS = (0.6, 0.75, 0.95)  # reduced areas of the published shapes (fig. 3)
_REDUCED_AREAS = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 0.98, 0.99)
_DISTANCES = (0.2, 0.3, 0.4)  # fig. 5
_HAMAKERS = (1.0, 2.0, 3.0, 4.0, 5.0)
_STRENGTHS = (3.0, 4.0, 5.0, 6.5)  # Hamaker constants for which the reduced area of least energy is computed
_AREA_OF_HAMAKERS = 0.95  # fig. 5


def _doublet(reduced_area: float, hamaker: float = _HAMAKER, distance: float = _DISTANCE) -> Case:
    return Case.of(
        "doublet-equilibrium",
        {
            "vesicles.reduced_area": reduced_area,
            "adhesion.hamaker": hamaker,
            "adhesion.distance": distance,
        },
    )


def _generate(quick: bool) -> SectionGenerator:
    areas = _REDUCED_AREAS[3:8] if quick else _REDUCED_AREAS
    strengths = (_HAMAKER,) if quick else _STRENGTHS
    distances, hamakers = (_DISTANCES[:1], _HAMAKERS[::2]) if quick else (_DISTANCES, _HAMAKERS)
    shape_cases = [_doublet(area) for area in _SHOWN_AREAS]
    published_cases = [_doublet(area) for area, _, _ in published()["doublets"]["energies"]]
    cases_by_area = {strength: {area: _doublet(area, strength) for area in areas} for strength in strengths}
    cases_by_hamaker = {
        distance: {hamaker: _doublet(_AREA_OF_HAMAKERS, hamaker, distance) for hamaker in hamakers}
        for distance in distances
    }
    varied = [
        case for cases in (*cases_by_area.values(), *cases_by_hamaker.values()) for case in cases.values()
    ]
    results = yield SectionPlan([*shape_cases, *published_cases, *varied])

    runs = {case: results.run(case) for case in shape_cases if not results.failed(case)}
    contacts = {case: contact_region(run) for case, run in runs.items()}
    contacts_by_area = {case.scene.vesicles[0].reduced_area: contact for case, contact in contacts.items()}
    by_area = {strength: doublet_energies(results, cases) for strength, cases in cases_by_area.items()}
    by_hamaker = {distance: doublet_energies(results, cases) for distance, cases in cases_by_hamaker.items()}
    best_areas = {strength: least_energy_parameter(energies) for strength, energies in by_area.items()}
    figures = equilibrium_figures
    return SectionContent(
        [
            _SHAPES_TEXT,
            SectionFigure("shapes", _SHAPES_CAPTION, figures.shapes(list(runs.values()))),
            SectionFigure("contact", _CONTACT_CAPTION, figures.contacts(contacts_by_area, _DISTANCE)),
            [row for case, contact in contacts.items() for row in _contact_comparisons(case, contact)],
            _AREA_TEXT,
            SectionFigure("reduced-area", _AREA_CAPTION, figures.energies_against_area(by_area, best_areas)),
            [
                *_energy_comparisons(results, published_cases),
                *_best_area_comparisons(best_areas, cases_by_area),
            ],
            _HAMAKER_TEXT,
            SectionFigure("hamaker", _HAMAKER_CAPTION, figures.energies_against_hamaker(by_hamaker)),
            _linearity_comparisons(by_hamaker, cases_by_hamaker),
        ]
    )


_SHAPES_TEXT = (
    "Two vesicles that are brought together at rest flatten each other.  The *edge* of the contact region "
    "is where the gap is smallest; the *dip* is by how much it is smaller there than on the line of "
    "centers.  The paper finds attraction in the contact region for the deflated vesicles, except at the "
    "edge, and repulsion for those of reduced area 0.95."
)
_SHAPES_CAPTION = (
    "Doublets at equilibrium, H = 5, δ = 0.2; color: tension, on one scale.  The contact region is "
    "compressed."
)
_CONTACT_CAPTION = (
    "The contact region (not to scale): half the gap against the distance from the line of centers; color: "
    "adhesive force toward the other vesicle, negative where it repels."
)
_AREA_TEXT = (
    "The published energies are those at the actual reduced areas 0.591, 0.797 and 0.948; the bending energy "
    "is that of both vesicles, or ∫κ² ds of one.  Past the paper: the reduced area at which the sum is "
    "smallest, for weaker and stronger adhesion.  Vesicles that could choose their area would take this one."
)
_AREA_CAPTION = (
    "Left: bending (solid) and adhesion (dash-dotted) energy against reduced area, H = 5; diamonds: "
    "published. Right: their sum, less its smallest value, for several H; dotted lines mark the minimum."
)
_HAMAKER_TEXT = (
    "At reduced area 0.95 the paper finds that the shape, hence the bending energy, hardly changes with H, "
    "and that the adhesion energy is linear in it.  An exponent of 1 is exact linearity."
)
_HAMAKER_CAPTION = (
    "Bending and adhesion energy of doublets of reduced area 0.95 against the Hamaker constant."
)


def _contact_comparisons(case: Case, contact: ContactRegion) -> list[Comparison]:
    area = case.scene.vesicles[0].reduced_area
    values, evidence = published()["doublets"], runs_of(case)
    inside = dict.fromkeys(values["attracted_inside"], "attracts")
    inside |= dict.fromkeys(values["repelled_inside"], "repels")
    return [
        compare_words(
            f"force in the middle, ΔA = {area:g}", inside[area], _sign(contact.pull_in_middle), evidence
        ),
        compare_words(f"force at the edge, ΔA = {area:g}", "repels", _sign(contact.pull_at_edge), evidence),
        compare_numbers(
            f"gap in the middle / δ, ΔA = {area:g}", None, contact.middle_gap / _DISTANCE, evidence
        ),
        compare_numbers(f"gap at the edge / δ, ΔA = {area:g}", None, contact.gap.min() / _DISTANCE, evidence),
        compare_numbers(f"dip at the edge, ΔA = {area:g}", None, contact.dip, evidence),
    ]


def _sign(pull: float) -> str:
    return "attracts" if pull > 0 else "repels"


def _energy_comparisons(results: Results, cases: Sequence[Case]) -> list[Comparison]:
    comparisons = []
    for case, (area, bending, adhesion) in zip(cases, published()["doublets"]["energies"], strict=True):
        energy, evidence = results.summary(case).energy, runs_of(case)
        comparisons += [
            compare_numbers(f"bending energy, ΔA = {area:g}", bending, energy.bending, evidence, allowed=1),
            compare_numbers(
                f"adhesion energy, ΔA = {area:g}", adhesion, energy.adhesion, evidence, allowed=1
            ),
        ]
    return comparisons


def _best_area_comparisons(
    best_areas: Mapping[float, float | None], cases_by_area: Mapping[float, Mapping[float, Case]]
) -> list[Comparison]:
    known = published()["doublets"]["minimum_of_total_energy"]
    return [
        compare_numbers(
            f"reduced area of least total energy, H = {strength:g}",
            known if strength == _HAMAKER else None,
            area,
            Evidence(tuple(case.key for case in cases_by_area[strength].values())),
            allowed=2 if strength == _HAMAKER else None,
            note="" if area is not None else "at an end of the range",
        )
        for strength, area in best_areas.items()
    ]


def _linearity_comparisons(
    by_hamaker: Mapping[float, Sequence[DoubletEnergy]],
    cases_by_hamaker: Mapping[float, Mapping[float, Case]],
) -> list[Comparison]:
    comparisons = []
    for distance, energies in by_hamaker.items():
        if len(energies) < 3:
            continue
        law = power_law([energy.parameter for energy in energies], [-energy.adhesion for energy in energies])
        change = 100 * (energies[-1].bending / energies[0].bending - 1)
        evidence = Evidence(tuple(case.key for case in cases_by_hamaker[distance].values()))
        comparisons += [
            compare_numbers(
                f"exponent of E_adh in H, δ = {distance:g}", 1.0, law.exponent, evidence, note=f"{law}"
            ),
            compare_numbers(f"change of E_bend over these H (%), δ = {distance:g}", None, change, evidence),
        ]
    return comparisons


SECTION = Section("doublets", "Doublets at equilibrium", _generate)
