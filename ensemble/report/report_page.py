"""A report as one HTML page, which holds its figures and its style and needs no other file."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template

from markdown_it import MarkdownIt
from markdown_it.token import Token

_PAGE = Template("""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root {
  color-scheme: light dark;
  --ink: light-dark(#222, #e4e4e0);
  --soft: light-dark(#555, #a9a9a4);
  --rule: light-dark(#ddd, #3a3d40);
  --ground: light-dark(#fff, #16181a);
  --code: light-dark(#f4f4f4, #24272a);
}
body {
  font: 16px/1.5 Georgia, serif; max-width: 58rem; margin: 2rem auto; padding: 0 1rem;
  color: var(--ink); background: var(--ground);
}
a { color: inherit; }
h1, h2 { font-weight: normal; line-height: 1.2; }
h2 { margin-top: 3rem; border-top: 1px solid var(--rule); padding-top: 1rem; }
nav { font: 14px/1.6 system-ui, sans-serif; margin: 1.5rem 0; }
nav ul { columns: 2 20rem; padding-left: 1.2rem; margin: 0.3rem 0; }
img { display: block; max-width: 100%; margin: 1.5rem auto 0.3rem; background: #fff; border-radius: 2px; }
table { border-collapse: collapse; font: 13px/1.35 system-ui, sans-serif; display: block; overflow-x: auto; }
th, td { padding: 0.25rem 0.6rem; text-align: left; border-bottom: 1px solid var(--rule); }
th, td { vertical-align: top; }
td { font-variant-numeric: tabular-nums; }
code { font-size: 0.85em; background: var(--code); overflow-wrap: anywhere; }
details { font-size: 0.9em; margin: 0.5rem 0 1.5rem; }
em { color: var(--soft); }
@media print {
  :root { color-scheme: light; }
  body { font-size: 10pt; max-width: none; margin: 0; }
  table { display: table; width: 100%; font-size: 7pt; }
  th, td { padding: 0.1rem 0.25rem; overflow-wrap: anywhere; }
  tr, img { break-inside: avoid; }
  h2 { break-after: avoid; }
}
</style>
$body
</html>
""")


def report_page(text: str, directory: Path) -> str:
    """Return a report as an HTML page.

    Below the conclusions it has a list of the sections with links to them.

    Parameters
    ----------
    text : str
        The report as Markdown: a heading, a list of conclusions, then sections.
    directory : Path
        Holds the images that the text shows, as PNG.

    Returns
    -------
    str
        The page.
    """
    # Reports fold the sources of a table away, which Markdown can say as HTML only.
    markdown = MarkdownIt("commonmark").enable("table")
    tokens = markdown.parse(text)
    headings = [
        (token, tokens[index + 1].content)
        for index, token in enumerate(tokens)
        if token.type == "heading_open"
    ]
    (_, title), *sections = headings
    for number, (heading, _) in enumerate(sections, start=1):
        heading.attrSet("id", f"section-{number}")
    for token in tokens:
        for child in token.children or ():
            if child.type == "image":
                image = directory / str(child.attrGet("src"))
                child.attrSet("src", f"data:image/png;base64,{b64encode(image.read_bytes()).decode()}")
    end = 1 + next(index for index, token in enumerate(tokens) if token.type == "bullet_list_close")
    contents = Token("html_block", "", 0, content=_contents([name for _, name in sections]))
    body = markdown.renderer.render([*tokens[:end], contents, *tokens[end:]], markdown.options, {})
    return _PAGE.substitute(title=escape(title), body=body)


def _contents(sections: Sequence[str]) -> str:
    if not sections:
        return ""
    links = (
        f'<li><a href="#section-{number}">{escape(name)}</a></li>'
        for number, name in enumerate(sections, start=1)
    )
    return "\n".join(["<nav>Contents<ul>", *links, "</ul></nav>\n"])
