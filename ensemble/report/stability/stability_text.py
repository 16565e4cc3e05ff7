"""The stability report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from ensemble.report.markdown_table import image_links, made_on, table
from ensemble.report.stability.stability_document import Stability, StabilityVerdict

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
    counts = {verdict: sum(row.verdict is verdict for row in report.rows) for verdict in StabilityVerdict}
    sections = [
        "# Stiff and extreme scenes",
        made_on(report.machine),
        f"{len(report.rows)} scenes: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()),
        *image_links(figures),
        "## Verdicts",
        "The first of these criteria that holds:",
        "\n".join(f"- **{verdict}**: {criterion}" for verdict, criterion in report.criteria.items()),
    ]
    for group in dict.fromkeys(row.group for row in report.rows):
        rows = [row for row in report.rows if row.group == group]
        sections += [f"## {group.capitalize()}", table(_SCENE_VERDICT, rows)]
    return "\n\n".join(sections) + "\n"
