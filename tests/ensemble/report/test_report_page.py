"""The page of a report says what its text says, and needs no other file."""

from __future__ import annotations

import re
from base64 import b64decode
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from ensemble.figures import save
from ensemble.report.report_page import report_page

TEXT = """# Made & up

- What it *comes* to.

Made on: a machine.

## First <section>

![curve](curve.png)

| scene | error |
| --- | --- |
| a | 1e-3 |

## Second

<details><summary>Runs and commands</summary><ul>
<li>one</li>
</ul></details>
"""


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("report")
    save(Figure(figsize=(2, 1)), made / "curve.png")
    return made


def test_the_page_has_what_the_text_has(directory: Path) -> None:
    page = report_page(TEXT, directory)
    assert "<title>Made &amp; up</title>" in page
    assert "<em>comes</em>" in page
    assert page.count("<table>") == 1
    assert "<td>1e-3</td>" in page
    assert "<summary>Runs and commands</summary>" in page


def test_the_contents_follow_the_conclusions_and_lead_to_every_section(directory: Path) -> None:
    page = report_page(TEXT, directory)
    links = re.findall(r'<a href="#([\w-]+)">([^<]+)</a>', page)
    assert [name for _, name in links] == ["First &lt;section&gt;", "Second"]
    assert all(f'<h2 id="{target}">' in page for target, _ in links)
    assert page.index("<em>comes</em>") < page.index("<nav>") < page.index("Made on")


def test_images_are_in_the_page(directory: Path) -> None:
    (image,) = re.findall(r'src="data:image/png;base64,([^"]+)"', report_page(TEXT, directory))
    assert b64decode(image) == (directory / "curve.png").read_bytes()
