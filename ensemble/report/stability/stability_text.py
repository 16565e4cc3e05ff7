"""The stability report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from ensemble.report.markdown_table import bullets, image_links, made_on, table
from ensemble.report.stability.stability_conclusions import stability_conclusions
from ensemble.report.stability.stability_document import Stability

# Headings of the table, and the fields below them.
_SCENE_VERDICT = {
    "scene": "scene",
    "verdict": "verdict",
    "reason": "reason",
    "outcome": "outcome",
    "time": "time",
    "area error": "area_error",
    "closure error": "closure_error",
    "position error": "global_error",
    "temporal error": "temporal_error",
    "spatial error": "spatial_error",
    "smallest gap": "smallest_gap",
    "energy rise": "energy_rise",
    "smallest step": "smallest_step",
    "steps": "steps",
    "evaluations": "evaluations",
    "seconds": "wall_seconds",
}

_PAIR_SYMMETRY = {
    "": "group",
    "scene": "scene",
    "outcome": "outcome",
    "period": "period",
    "growth rate": "growth_rate",
    "factor in a period": "growth_factor",
    "stable": "stable",
    "remark": "reason",
    "seconds of the run": "wall_seconds",
}

_PAIRS = (
    "A pair of equal vesicles is computed as one and its image, which cannot show what breaks this "
    "symmetry.  So both are computed, each on its own, from the end of the run, with a small difference "
    "between them, for two periods.  The growth is that in the second one, of the difference that decays "
    "most slowly.  `ensemble steady` does the same for one scene."
)


def stability_text(report: Stability, figures: Sequence[str]) -> str:
    """Return the report as Markdown.

    Parameters
    ----------
    report : Stability
        The report as data.
    figures : sequence of str
        Names of the image files to show.

    Returns
    -------
    str
        The text.
    """
    sections = [
        "# Stability: stiff and extreme scenes, and the symmetry of pairs",
        bullets(stability_conclusions(report)),
        made_on(report.machine),
        *image_links(figures),
        "## Verdicts",
        "The first of these criteria that holds:",
        "\n".join(f"- **{verdict}**: {criterion}" for verdict, criterion in report.criteria.items()),
    ]
    for group in dict.fromkeys(row.group for row in report.rows):
        rows = [row for row in report.rows if row.group == group]
        sections += [f"## {group.capitalize()}", table(_SCENE_VERDICT, rows)]
    sections += ["## Symmetry of bound pairs", _PAIRS, table(_PAIR_SYMMETRY, report.pairs)]
    return "\n\n".join(sections) + "\n"
