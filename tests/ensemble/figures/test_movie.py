"""Movies show the run that they are given: seen in the pictures that a decoder gets out of the files."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from ensemble.figures import movie
from ensemble.figures.movie import Picture, picture_times, save_movie
from solver.analysis.run import Frames, Run
from solver.membrane.curve import positions
from tests.ensemble.made_runs import orbit
from tests.ensemble.runs import failed_run

HOLD = 1.0


def few_frames(run: Run, frames: int = 5) -> Run:
    """The run with its first frames only."""
    return replace(run, frames=Frames(*(values[:frames] for values in vars(run.frames).values())))


def decoded(path: Path) -> Iterator[np.ndarray]:
    """Pictures of a file, (height, width, 3)."""
    if path.suffix == ".gif":
        with Image.open(path) as image:
            for index in range(image.n_frames):
                image.seek(index)
                yield np.asarray(image.convert("RGB"))
        return
    reader = imageio_ffmpeg.read_frames(str(path))
    width, height = next(reader)["size"]
    for frame in reader:
        yield np.frombuffer(frame, np.uint8).reshape(height, width, 3)


def duration(path: Path) -> float:
    """Seconds that a player takes."""
    if path.suffix == ".gif":
        with Image.open(path) as image:
            return sum(_shown(image, index) for index in range(image.n_frames)) / 1000
    reader = imageio_ffmpeg.read_frames(str(path))
    seconds = float(next(reader)["duration"])
    reader.close()
    return seconds


def _shown(image: Image.Image, index: int) -> float:
    image.seek(index)
    return float(image.info["duration"])


FORMATS = pytest.mark.parametrize(("suffix", "size"), [(".mp4", (720, 1280)), (".gif", (360, 640))])


@FORMATS
def test_the_pictures_of_a_file_show_the_membranes_where_they_are(
    tmp_path: Path, suffix: str, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A movie of a few pictures: their number is what takes time.
    monkeypatch.setattr(movie, "_DURATION", (0.4, 20.0))
    monkeypatch.setattr(movie, "_HOLD", 0.1)
    run, path = few_frames(orbit()), tmp_path / f"run{suffix}"
    counted: list[tuple[int, int]] = []
    save_movie(run, path, lambda drawn, total: counted.append((drawn, total)))
    assert counted == [(drawn, len(counted)) for drawn in range(1, len(counted) + 1)]
    assert list(tmp_path.iterdir()) == [path]
    assert duration(path) == pytest.approx(0.4 + 0.1, abs=0.2)
    pictures = list(decoded(path))
    assert pictures[0].shape == (*size, 3)

    picture = Picture(run, size[0] / 3.0)
    for shown, time in ((pictures[0], 0.0), (pictures[-1], 4.0)):
        picture.show(time)
        on_membranes = np.array(picture.membranes.get_segments())[:, 0]
        inside = on_membranes.reshape(2, -1, 2).mean(axis=1)
        assert brightness(shown, picture, on_membranes).max() < 200
        assert brightness(shown, picture, inside).min() > 220
    changed = np.abs(pictures[0].astype(int) - pictures[-1]).max(axis=2) > 40
    assert changed.mean() > 0.002


@pytest.mark.long
@FORMATS
def test_a_movie_lasts_as_long_as_it_should(tmp_path: Path, suffix: str, size: tuple[int, int]) -> None:
    path = tmp_path / f"run{suffix}"
    save_movie(few_frames(orbit()), path)
    assert duration(path) == pytest.approx(5.0 + HOLD, abs=0.2)
    pictures = list(decoded(path))
    assert len(pictures) > 90
    assert pictures[-1].shape == (*size, 3)


def brightness(shown: np.ndarray, picture: Picture, points: np.ndarray) -> np.ndarray:
    """Mean of red, green and blue at points (n, 2) of the membranes' axes."""
    axes = next(axes for axes in picture.figure.axes if axes.get_label() == "membranes")
    column, row = np.round(axes.transData.transform(points) - 0.5).astype(int).T
    return np.asarray(shown[shown.shape[0] - 1 - row, column].mean(axis=1))


def test_a_picture_shows_a_recorded_state_exactly_and_interpolates_between_two() -> None:
    run = orbit()
    coarse = replace(run, frames=Frames(*(values[::2] for values in vars(run.frames).values())))
    for made, error in ((run, 1e-12), (coarse, 2e-2)):
        picture = Picture(made, 80)
        for index in (0, 11, 13):
            picture.show(run.frames.time[index])
            drawn = np.array(picture.membranes.get_segments())[:, 0].reshape(2, -1, 2)[:, ::2]
            exact = positions(run.frames.tangent_angle[index], run.frames.center[index], 2 * np.pi)
            exact -= run.frames.center[index].mean(axis=0)[:, None]
            np.testing.assert_allclose(drawn.swapaxes(1, 2), exact, atol=error)


@pytest.mark.parametrize("vesicles", [1, 2, 5])
@pytest.mark.parametrize("flow", ["shear", "trap", None])
def test_all_vesicles_are_in_view_beside_what_was_recorded(vesicles: int, flow: str | None) -> None:
    run = orbit(vesicles=vesicles, flow=flow, adhesion=vesicles > 1)
    picture = Picture(run, 80)
    view, _, *traces = picture.figure.axes
    assert view.get_label() == "membranes"
    assert all(axes.get_label() in run.series for axes in traces)
    assert len(traces) == 2
    arrows = [artist for artist in view.collections if artist.get_label() == "imposed flow"]
    assert len(arrows) == (flow is not None)
    x, y = view.get_xlim()[1], view.get_ylim()[1]
    width, height = view.bbox.size
    assert x / width == pytest.approx(y / height)
    for time in (0.0, 20.0, 40.0):
        picture.show(time)
        points = np.array(picture.membranes.get_segments()).reshape(-1, 2)
        assert np.all(np.abs(points) < (x, y))
        assert len(points) >= 2 * 64 * vesicles


def test_a_long_run_is_shown_faster_and_its_end_stays() -> None:
    frames = orbit().frames
    for last, seconds in ((4.0, 5.0), (100.0, 12.5), (2000.0, 20.0)):
        times = picture_times(replace(frames, time=np.linspace(0, last, 41)), 30)
        assert len(times) == round(30 * (seconds + HOLD)) + 1
        assert times[0] == 0
        np.testing.assert_array_equal(times[-30:], last)
        assert np.ptp(np.diff(times[:-30])) < 1e-9


def test_a_single_state_stays() -> None:
    run = few_frames(orbit(), 1)
    np.testing.assert_array_equal(picture_times(run.frames, 20), np.zeros(21))
    Picture(run, 80).show(0.0)


def test_a_run_without_a_finite_state_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="output: the run has no finite state"):
        save_movie(failed_run(), tmp_path / "run.gif")
    assert not list(tmp_path.iterdir())


def test_the_arrows_are_the_flow_relative_to_the_mean_of_the_vesicles() -> None:
    run = orbit(flow="shear")  # about (5, 1), so that the flow at the mean is not zero
    picture = Picture(run, 80)
    picture.show(3.0)
    view = picture.figure.axes[0]
    (arrows,) = (artist for artist in view.collections if artist.get_label() == "imposed flow")
    y = np.array(arrows.get_offsets())[:, 1]
    assert np.ptp(y) > 1
    assert not np.any(arrows.V)
    np.testing.assert_allclose(arrows.U / np.abs(arrows.U).max(), y / np.abs(y).max(), atol=1e-12)


def test_without_the_extra_an_mp4_is_refused_and_a_gif_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)  # as if it were not installed
    run = few_frames(orbit(), 1)  # makes the shortest movie
    with pytest.raises(ValueError, match=r"the extra movies, pip install 'vesicle-ensemble\[movies\]'"):
        save_movie(run, tmp_path / "run.mp4")
    save_movie(run, tmp_path / "run.gif")
    assert [path.name for path in tmp_path.iterdir()] == ["run.gif"]
