"""The report on the paper as Markdown."""

from __future__ import annotations

from html import escape

from ensemble.report.markdown_table import bullets
from ensemble.report.paper.comparison import PERCENT, Comparison, Value
from ensemble.report.paper.paper_document import Paper, PaperSection, ReportFigure

_ABSENT = "–"
_KEY_DIGITS = 8  # of a run's key, in tables; enough to find it

_SOURCE = (
    "B. Quaife, S. Veerapaneni and Y.-N. Young, *Hydrodynamics and rheology of a vesicle doublet "
    "suspension*, Phys. Rev. Fluids (2019)"
)


def paper_conclusions(paper: Paper) -> list[str]:
    """Return what the report comes to.

    Parameters
    ----------
    paper : Paper
        The report as data.

    Returns
    -------
    list of str
        A sentence each.
    """
    judged = [row for part in paper.parts for row in part.rows if row.agrees is not None]
    apart = [part.title for part in paper.parts if any(row.agrees is False for row in part.rows)]
    kept = sum(bool(row.agrees) for row in judged)
    return [
        f"{kept} of {len(judged)} values agree with the published ones within the allowed deviation.",
        *([f"The others are in: {'; '.join(apart)}."] if apart else []),
        f"{'Quick (thinned) report.  ' if paper.quick else ''}{paper.runs} runs were made now, in "
        f"{paper.wall_seconds:.0f} s on {paper.ranks} ranks; the others were in the store.",
    ]


def paper_text(paper: Paper) -> str:
    """Return the report as Markdown.

    Parameters
    ----------
    paper : Paper
        The report as data.

    Returns
    -------
    str
        The text.
    """
    sections = [
        "# The paper, recomputed",
        bullets(paper_conclusions(paper)),
        f"{_SOURCE}: its figures and tables, computed again and compared with the published values.  The "
        "*deviation* is that of the computed value from the published one; for brackets it is the distance "
        "between them, 0 where they overlap.",
        f"Made on: {paper.machine.sentence()}.",
        *(text for part in paper.parts for text in _part_text(part)),
    ]
    return "\n\n".join(sections) + "\n"


def _part_text(part: PaperSection) -> list[str]:
    texts = [f"## {part.title}"]
    for element in part.content:
        match element:
            case str():
                texts.append(element)
            case ReportFigure():
                texts += [
                    f"![{element.name}]({element.name}.png)",
                    f"*{element.caption}*",
                    f"`{element.command}`",
                ]
            case list():
                texts += [_table(element), _sources(element)]
    return texts


def _table(rows: list[Comparison]) -> str:
    noted = any(row.note for row in rows)
    heading = ["", "published", "computed", "deviation", "allowed", *(["note"] if noted else [])]
    lines = [heading, ["---"] * len(heading)]
    for row in rows:
        allowed = _ABSENT if row.allowed is None else f"± {row.allowed:g}{_unit(row)}"
        judged = "" if row.agrees is None else " ✓" if row.agrees else " ✗"
        lines.append(
            [
                row.quantity,
                _value(row.published),
                _value(row.computed),
                _deviation(row) + judged,
                allowed,
                *([row.note] if noted else []),
            ]
        )
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _sources(rows: list[Comparison]) -> str:
    """Return the runs and commands behind a table, folded away."""
    items = []
    for row in rows:
        if row.command or row.runs:
            keys = " ".join(key[:_KEY_DIGITS] for key in row.runs)
            command = f"<code>{escape(row.command)}</code>" if row.command else ""
            items.append(f"<li>{escape(row.quantity)}: {command} {f'(runs {keys})' if keys else ''}</li>")
    if not items:
        return ""
    # One block without empty lines, or Markdown would end the HTML there.
    return "\n".join(["<details><summary>Runs and commands</summary><ul>", *items, "</ul></details>"])


def _value(value: Value) -> str:
    match value:
        case None:
            return _ABSENT
        case str():
            return value
        case (low, high):
            return f"{low:.4g} to {high:.4g}"
        case _:
            return f"{value:.4g}"


def _deviation(row: Comparison) -> str:
    if row.deviation is None:
        return ""
    digits = 2 if row.unit == PERCENT else 3
    return f"{row.deviation:+.{digits}f}{_unit(row)}"


def _unit(row: Comparison) -> str:
    return f" {row.unit}" if row.unit == PERCENT or row.unit[:1].isalpha() else row.unit
