"""Files of figures are complete and reproducible."""

from __future__ import annotations

import itertools
import os
import re
import struct
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import pytest
from matplotlib.figure import Figure

from ensemble.config.figure_options import FigureOptions
from ensemble.figures import draw_run, run_figure, save
from ensemble.figures.fitted import fitted_run_figure
from ensemble.figures.symbols import number_text
from solver.analysis.run import Run
from tests.ensemble.made_runs import orbit, suspension

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


def test_letters_of_an_svg_may_be_text_and_a_figure_has_the_size_that_is_asked_for(tmp_path: Path) -> None:
    options = FigureOptions(size=(2.54 * 5, 2.54 * 8), svg_text=True)
    draw_run(orbit(), tmp_path / "run.svg", options)
    text = (tmp_path / "run.svg").read_text()
    root = ElementTree.fromstring(text)
    assert (root.get("width"), root.get("height")) == ("360pt", "576pt")
    words = {"".join(each.itertext()).strip() for each in root.iter("{http://www.w3.org/2000/svg}text")}
    assert "gap" in words
    save(run_figure(orbit()), tmp_path / "curves.svg")
    assert "<text" not in (tmp_path / "curves.svg").read_text()
    draw_run(orbit(), tmp_path / "run.png", FigureOptions(size=(2.54 * 5, 2.54 * 8), dpi=50))
    width, height = struct.unpack(">II", (tmp_path / "run.png").read_bytes()[16:24])
    assert (width, height) == (250, 400)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "run", [orbit(), orbit(flow="trap"), suspension()], ids=["shear", "trap", "clusters"]
)
def test_a_narrow_figure_of_a_run_has_room_for_its_letters(run: Run) -> None:
    figure = fitted_run_figure(run, (8.6, 20.0))
    figure.set_size_inches(8.6 / 2.54, 20 / 2.54)
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.texts]
    boxes += [axes.get_tightbbox() for axes in figure.axes]
    assert all(figure.bbox.padded(1).containsx(x) for box in boxes for x in (box.x0, box.x1))
    assert all(figure.bbox.padded(1).containsy(y) for box in boxes for y in (box.y0, box.y1))
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


@pytest.mark.filterwarnings("error")
def test_a_size_without_room_is_refused_with_one_that_suffices(tmp_path: Path) -> None:
    path, run = tmp_path / "run.png", orbit(vesicles=1, flow=None, adhesion=False)
    with pytest.raises(ValueError, match=r"size: 8\.6x6 is too small for this run; at a width of") as refusal:
        draw_run(run, path, FigureOptions(size=(8.6, 6)))
    assert not path.exists()
    named = re.search(r"at a width of 8.6 cm it needs a height of (\d+) cm", str(refusal.value))
    assert named is not None
    draw_run(run, path, FigureOptions(size=(8.6, float(named[1])), dpi=30))
    assert path.exists()


@pytest.mark.filterwarnings("error")
def test_no_figure_is_written_without_room_for_its_letters(tmp_path: Path) -> None:
    figure = Figure(layout="constrained")
    figure.add_subplot(ylabel="gap", xlabel="time", title="a\nb\nc\nd\ne\nf\ng\nh\ni")
    with pytest.raises(ValueError, match="size: 3x3 is too small for the letters of this figure"):
        save(figure, tmp_path / "figure.svg", FigureOptions(size=(3, 3)))
    assert not list(tmp_path.iterdir())


def test_numbers_in_figures_have_true_minus_signs() -> None:
    assert number_text(-0.25) == "−0.25"
    assert number_text(-2.5e-7, 2) == "−2.5e−07"


@pytest.mark.parametrize(
    ("option", "named"),
    [
        ("--size=8.6", "size: '8.6' — must be width x height in centimeters"),
        ("--size=8.6x1", "size.1: 1.0"),
        ("--dpi=3", "dpi: 3"),
    ],
)
def test_other_sizes_are_refused_by_name(ensemble, finished_study, option: str, named: str) -> None:
    store = f"--store={finished_study.store}"
    refused = ensemble("show", "critical-hamaker", "--output=figure.svg", option, store)
    assert refused.returncode == 2
    assert named in refused.stderr


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--size=8x6",), "--size — needs --output"),
        (("--dpi=300", "--svg-text"), "--dpi and --svg-text — needs --output"),
        (("--json", "--output=figure.svg"), "--json — nothing is printed with --output"),
    ],
)
def test_options_that_would_change_nothing_are_refused(
    ensemble, finished_study, options: tuple[str, ...], named: str
) -> None:
    refused = ensemble("show", "critical-hamaker", *options, f"--store={finished_study.store}")
    assert refused.returncode == 2
    assert named in refused.stderr
    assert refused.stdout == ""


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


def test_the_settings_of_a_user_change_no_figure(tmp_path: Path) -> None:
    """A file of settings, such as people have in their home directory, that breaks or changes plots."""
    (tmp_path / "matplotlibrc").write_text(
        "text.usetex: True\naxes.grid: True\npath.sketch: 3, 100, 2\nlines.linewidth: 9\nfont.size: 30\n"
        "axes.facecolor: red\nsavefig.bbox: tight\nfigure.constrained_layout.use: True\n"
        "axes.unicode_minus: False\n"
    )
    code = (
        "import sys; from pathlib import Path; from ensemble.figures import draw_run, run_figure, save;"
        "from tests.ensemble.made_runs import orbit; save(run_figure(orbit()), Path(sys.argv[1]))"
    )
    for name, settings in (("plain.svg", tmp_path / "none"), ("user.svg", tmp_path / "matplotlibrc")):
        subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / name)],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "MATPLOTLIBRC": str(settings)},
            check=True,
        )
    assert (tmp_path / "user.svg").read_bytes() == (tmp_path / "plain.svg").read_bytes()


def test_the_target_of_a_link_is_replaced_and_the_link_stays(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link, target = tmp_path / "link.svg", tmp_path / "elsewhere" / "figure.svg"
    link.symlink_to(target)
    for _ in range(2):
        save(Figure(), link)
        assert link.is_symlink()
        assert target.read_bytes().startswith(b"<?xml")
    assert [path.name for path in target.parent.iterdir()] == [target.name]


def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.svg"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE) as reader:
        save(Figure(), pipe)
        assert reader.communicate()[0].startswith(b"<?xml")
    assert pipe.is_fifo()


def test_a_directory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "figure.svg").mkdir()
    with pytest.raises(OSError, match="is a directory"):
        save(Figure(), tmp_path / "figure.svg")
    assert list(tmp_path.rglob("*")) == [tmp_path / "figure.svg"]
