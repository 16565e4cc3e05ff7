"""Files of figures are complete and reproducible."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest
from matplotlib.figure import Figure

from ensemble.figures import run_figure, save
from tests.ensemble.made_runs import orbit

FIRST_BYTES = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


@pytest.mark.parametrize("suffix", FIRST_BYTES)
def test_equal_figures_are_equal_undated_files(tmp_path: Path, suffix: str) -> None:
    one, other = tmp_path / f"one{suffix}", tmp_path / f"other{suffix}"
    other.write_text("an earlier figure")
    for path in (one, other):
        save(run_figure(orbit()), path)
    assert one.read_bytes() == other.read_bytes()
    assert one.read_bytes().startswith(FIRST_BYTES[suffix])
    assert b"CreationDate" not in one.read_bytes()
    assert b"dc:date" not in one.read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {one.name, other.name}


def test_other_suffixes_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"output: must end in \.png, \.svg or \.pdf, got 'run\.mp4'"):
        save(Figure(), tmp_path / "run.mp4")
    assert not list(tmp_path.iterdir())


def test_a_figure_that_cannot_be_written_leaves_the_earlier_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "figure.svg"
    path.write_text("an earlier figure")
    figure = Figure()
    figure.text(0.5, 0.5, r"$\frac{$")  # found out only while drawing
    with pytest.raises(ValueError, match="frac"):
        save(figure, path)
    assert path.read_text() == "an earlier figure"
    assert list(tmp_path.iterdir()) == [path]


def test_figures_leave_no_global_state(tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    save(run_figure(orbit()), tmp_path / "run.png")
    assert dict(matplotlib.rcParams) == before
    code = "import sys, ensemble.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
