"""Every public function says what it is given, and every source that is cited is in the list of references.

`numpydoc lint` reads the source and checks the form.  Here the imported packages are asked, so that what a
decorator hides is counted too.
"""

from __future__ import annotations

import re
from pathlib import Path

from numpydoc.docscrape import NumpyDocString

from tests.documentation.command_line import COMMAND_LINE, FUNCTIONS
from tests.documentation.public_objects import Documented, public_objects

ROOT = Path(__file__).parents[2]

_AUTHOR = r"[A-Z][\w’'-]+"
# "Kress 2014", "Quaife et al. 2019", "Dutt, Greengard & Rokhlin 2000"; also with the year in parentheses.
_CITATION = re.compile(
    rf"(?<!Rev\. )({_AUTHOR}(?:, {_AUTHOR})*(?: et al\.| & {_AUTHOR})?) \(?((?:19|20)\d\d)\b"
)


def documented_parameters(documented: Documented) -> set[str]:
    """Names in the sections that describe arguments."""
    sections = NumpyDocString(documented.docstring)
    entries = [entry for section in ("Parameters", "Other Parameters") for entry in sections[section]]
    return {name.strip().lstrip("*") for entry in entries for name in entry.name.split(",")}


def test_public_functions_are_found_however_they_are_decorated() -> None:
    names = {documented.name for documented in public_objects()}
    assert "solver.potentials.direct_sum.velocity" in names  # compiled
    assert "solver.membrane.spectral.differentiation" in names  # cached
    assert "solver.membrane.geometry.Membranes.of_scene" in names  # a class method
    assert "api.commands.serve" in names  # a command


def test_every_public_function_with_arguments_documents_all_of_them() -> None:
    commands = {f"{function.__module__}.{function.__qualname__}" for function in FUNCTIONS}
    missing = {
        documented.name: sorted(set(documented.arguments) - documented_parameters(documented))
        for documented in public_objects()
        if documented.name not in commands
    }
    assert not {name: arguments for name, arguments in missing.items() if arguments}
    assert commands.isdisjoint(missing)


def test_every_option_of_a_command_has_a_help_text() -> None:
    silent = [
        f"{name} {parameter.name}"
        for name, command in COMMAND_LINE.commands.items()
        for parameter in command.params
        if not getattr(parameter, "help", None)
    ]
    assert len(COMMAND_LINE.commands) > 8
    assert not silent


def test_every_public_object_has_a_docstring() -> None:
    assert not [documented.name for documented in public_objects() if not documented.docstring.strip()]


def cited_sources(text: str) -> set[str]:
    """Keys of the sources that a text cites, as the list of references writes them."""
    return {f"{authors} {year}" for authors, year in _CITATION.findall(" ".join(text.split()))}


def listed_sources() -> set[str]:
    """Keys in the list of references."""
    text = (ROOT / "solver" / "README.md").read_text()
    return set(re.findall(r"^- \*\*(.+? \d{4})\.\*\*", text, flags=re.MULTILINE))


def test_citations_are_recognized() -> None:
    text = (
        "After Kress (2014) and Dutt, Greengard & Rokhlin 2000 (see Quaife et al. 2019, eq. 2); in March 2020"
    )
    expected = {"Kress 2014", "Dutt, Greengard & Rokhlin 2000", "Quaife et al. 2019", "March 2020"}
    assert cited_sources(text) == expected


def test_every_source_cited_in_the_code_is_in_the_list_of_references() -> None:
    unknown = {
        str(path.relative_to(ROOT)): sorted(cited_sources(path.read_text()) - listed_sources())
        for package in ("solver", "ensemble", "api")
        for path in sorted((ROOT / package).rglob("*.py"))
        if cited_sources(path.read_text()) - listed_sources()
    }
    assert not unknown
