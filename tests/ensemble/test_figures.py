"""Figures show exactly the data they are given, and their files are complete and reproducible."""

from __future__ import annotations

import itertools
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ensemble.boundary import Boundary, BoundaryPoint
from ensemble.figures import phase_diagram, run_figure, save
from ensemble.figures.style import MARKS, TENSION_COLORS
from ensemble.figures.symbols import describe
from solver.curve import positions
from solver.run import Energy, Errors, Frames, Outcome, Run, Work
from solver.scene import Scene, Vesicle

POINTS = 64
ALPHA = 2 * np.pi * np.arange(POINTS) / POINTS


def scene(vesicles: int = 2, flow: str | None = "shear", adhesion: bool = True) -> Scene:
    return Scene.model_validate(
        {
            "horizon": 40.0,
            "vesicles": [{"center": (3.0 * i, 0.0)} for i in range(vesicles)],
            "flow": {"kind": flow, "rate": 0.5} if flow else None,
            "adhesion": {"hamaker": 1.5, "distance": 0.4} if adhesion else None,
        }
    )


def boundary(
    points: list[BoundaryPoint],
    sweep: str = "flow.rate",
    search: str = "adhesion.hamaker",
    flow: str = "shear",
) -> Boundary:
    study = {
        "scene": scene(flow=flow).model_dump(mode="json"),
        "search": {"parameter": search},
        "sweep": {"parameter": sweep},
    }
    updated = datetime(2026, 1, 1, tzinfo=UTC)
    return Boundary(study_key="0", study=study, name="test", points=points, updated=updated)


def point(sweep: float, critical: float, **fields: Any) -> BoundaryPoint:
    """A point of the boundary whose bracket has this geometric mean."""
    return BoundaryPoint.model_validate(
        {
            "parameters": {"flow.rate": sweep},
            "bracket": (critical / 1.25, critical * 1.25),
            "outcomes": ("separated", "bound"),
            "status": "converged",
            "certified": False,
            "runs": [],
        }
        | fields
    )


def orbit(vesicles: int = 2, flow: str | None = "shear", adhesion: bool = True) -> Run:
    """A made-up run: ovals on a turning line, whose tension is a known function of arclength and time."""
    time = np.arange(0.0, 41.0)
    turn = -0.2 * time[:, None, None]
    tangent_angle = ALPHA + np.pi / 2 - 0.3 * np.sin(2 * ALPHA) + turn + np.zeros((1, vesicles, 1))
    place = (np.arange(vesicles) - (vesicles - 1) / 2)[:, None]
    center = 2.6 * place * np.stack([np.cos(turn[..., 0]), np.sin(turn[..., 0])], axis=-1) + (5.0, 1.0)
    tension = known_tension(ALPHA, time[:, None, None], np.arange(vesicles)[:, None])
    series = {
        "time": time,
        "bending_energy": 8 + np.cos(time),
        "area_error": 0 * time,
        "closure_error": 0 * time,
    }
    if vesicles > 1:
        series["gap"] = 0.5 + 0.1 * np.cos(time)
    if vesicles == 2:
        series |= {"center_distance": 2.6 + 0 * time, "center_angle": -0.2 * time}
    if vesicles == 1:
        series["inclination_angle"] = 0.4 + 0.1 * np.cos(time)
    if adhesion:
        series["adhesion_energy"] = -3 + 0.1 * np.cos(time)
    if flow == "shear":
        series["viscosity_bending_tension"] = 1.8 + 0.1 * np.cos(time)
        if adhesion:
            series["viscosity_adhesion"] = 0.2 + 0.1 * np.cos(time)
    return Run(
        scene=scene(vesicles, flow, adhesion),
        outcome=Outcome.BOUND,
        failure=None,
        time=40.0,
        period=31.4,
        effective_aspect_ratio=None,
        inclination_angle=None,
        gap=0.5,
        viscosity=None,
        energy=Energy(8.0, -3.0),
        error=Errors(0.0, 0.0, 0.0, 0.0),
        work=Work(1, 0, 1, 1, 1, 0.1),
        series=series,
        frames=Frames(time, tangent_angle, center, tension),
    )


def known_tension(alpha: Any, time: Any, vesicle: Any) -> Any:
    return np.cos(2 * alpha + vesicle) + 0.1 * time


def suspension(spread: float = 1.0) -> Run:
    """A made-up run of six vesicles of which, at the end, three are together and two others are."""
    run = orbit(6)
    place = np.array([(3.0 * column, 3.0 * row) for row in range(2) for column in range(3)])
    center = np.tile(place * (spread, 1.0), (len(run.frames.time), 1, 1))
    labels = np.tile(np.arange(6.0), (len(run.series["time"]), 1))
    labels[-5:] = (0, 0, 1, 0, 2, 2)
    sizes = {"clusters": labels.max(axis=1) + 1, "largest_cluster": np.where(labels[:, 1] == 0, 3.0, 1.0)}
    return replace(
        run,
        series={**run.series, **sizes},
        frames=replace(run.frames, center=center),
        vesicle_series={"vesicle_cluster": labels},
    )


def artist(axes: Axes, group: str) -> Any:
    (found,) = axes.findobj(lambda candidate: candidate.get_gid() == group)
    return found


def panel(figure: Figure, name: str) -> Axes:
    (found,) = (axes for axes in figure.axes if axes.get_label() == name)
    return found


def snapshots(figure: Figure) -> tuple[LineCollection, Axes]:
    axes = panel(figure, "membranes")
    (lines,) = (found for found in axes.collections if isinstance(found, LineCollection))
    return lines, axes


def segments(figure: Figure, vesicles: int = 2, pieces: int = 128) -> Any:
    """Ends of the drawn segments, shape (snapshots, vesicles, segments, 2 ends, 2)."""
    return np.array(snapshots(figure)[0].get_segments()).reshape(-1, vesicles, pieces, 2, 2)


def snapshot_times(axes: Axes) -> list[float]:
    return [float(text.get_text().split("=")[1]) for text in axes.texts]


# --- the phase diagram ---

SHEAR_RATE = r"shear rate, $\dot{\gamma}$"
EXTENSION_RATE = r"extension rate, $\dot{\epsilon}$"


def test_every_run_is_one_mark_of_its_outcome() -> None:
    runs = [
        (0.25 * (1 + i % 4), 0.1 + 0.01 * i, outcome)
        for i, outcome in enumerate(
            outcome for count, outcome in enumerate(Outcome, start=1) for _ in range(count)
        )
    ]
    axes = phase_diagram(boundary([]), runs).axes[0]
    for outcome in Outcome:
        mark = artist(axes, f"run {outcome}")
        drawn = sorted(zip(mark.get_xdata(), mark.get_ydata(), strict=True))
        assert drawn == sorted((sweep, value) for sweep, value, result in runs if result == outcome)


def test_outcomes_without_runs_are_not_in_the_legend() -> None:
    figure = phase_diagram(boundary([]), [(0.5, 1.0, Outcome.BOUND)])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["bound"]


def test_outcomes_differ_in_color_and_in_shape() -> None:
    assert set(MARKS) == set(Outcome)
    assert len({mark.color for mark in MARKS.values()}) == len(Outcome)
    assert len({mark.shape for mark in MARKS.values()}) == len(Outcome)


def test_bars_span_the_brackets_and_open_brackets_have_none() -> None:
    points = [point(1.0, 0.7), point(0.5, 0.36), point(0.75, 0.5, bracket=(0.4, None), status="open")]
    axes = phase_diagram(boundary(points), []).axes[0]
    expected = [[(0.5, 0.36 / 1.25), (0.5, 0.36 * 1.25)], [(1.0, 0.7 / 1.25), (1.0, 0.7 * 1.25)]]
    np.testing.assert_allclose(artist(axes, "bracket").get_segments(), expected, rtol=1e-14)


def test_critical_values_are_joined_in_the_order_of_the_sweep() -> None:
    axes = phase_diagram(boundary([point(1.0, 0.7), point(0.25, 0.2), point(0.5, 0.36)]), []).axes[0]
    line = artist(axes, "boundary")
    np.testing.assert_allclose(line.get_xdata(), [0.25, 0.5, 1.0], rtol=0)
    np.testing.assert_allclose(line.get_ydata(), [0.2, 0.36, 0.7], rtol=1e-14)


def fitted(line: Line2D) -> tuple[float, float]:
    (x0, x1), (y0, y1) = line.get_xdata(), line.get_ydata()
    slope = (y1 - y0) / (x1 - x0)
    return slope, y0 - slope * x0


def test_the_fit_recovers_a_line_and_states_it() -> None:
    figure = phase_diagram(boundary([point(x, 0.66 * x - 0.035) for x in (0.25, 0.5, 1.0, 1.5)]), [])
    assert fitted(artist(figure.axes[0], "fit")) == pytest.approx((0.66, -0.035), rel=1e-12)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert r"fit, ${\mathcal{H}}_c$ = 0.66 $\dot{\gamma}$ − 0.035" in labels


def test_the_fit_is_the_least_squares_line_of_the_converged_points_alone() -> None:
    sweep, critical = [0.25, 0.5, 1.0, 1.5], [0.21, 0.35, 0.74, 1.02]
    points = [point(x, y) for x, y in zip(sweep, critical, strict=True)]
    stray = point(2.0, 9.0, status="open")
    axes = phase_diagram(boundary([*points, stray]), []).axes[0]
    assert fitted(artist(axes, "fit")) == pytest.approx(tuple(np.polyfit(sweep, critical, 1)), rel=1e-10)


def test_two_points_are_not_fitted() -> None:
    axes = phase_diagram(boundary([point(0.5, 0.36), point(1.0, 0.7)]), []).axes[0]
    assert not axes.findobj(lambda candidate: candidate.get_gid() == "fit")


def test_the_legend_counts_certified_brackets() -> None:
    points = [point(0.5, 0.36, certified=True), point(1.0, 0.7)]
    figure = phase_diagram(boundary(points), [])
    assert "bracket (1 of 2 certified)" in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize(
    ("sweep", "search", "flow", "x", "y"),
    [
        ("flow.rate", "adhesion.hamaker", "shear", SHEAR_RATE, r"Hamaker constant, $\mathcal{H}$"),
        ("vesicles.reduced_area", "flow.rate", "trap", r"reduced area, $\Delta A$", EXTENSION_RATE),
        ("adhesion.distance", "flow.rate", "extension", r"separation distance, $\delta$", EXTENSION_RATE),
    ],
)
def test_axes_carry_the_symbols_of_the_field(sweep: str, search: str, flow: str, x: str, y: str) -> None:
    axes = phase_diagram(boundary([], sweep, search, flow), []).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (x, y)


def test_a_parameter_without_a_symbol_stands_for_itself() -> None:
    axes = phase_diagram(boundary([], sweep="criteria.separated_distance"), []).axes[0]
    assert axes.get_xlabel() == "criteria.separated_distance"


@pytest.mark.parametrize("search", ["flow.rate", "vesicles.bending_modulus", "criteria.separated_distance"])
def test_the_equation_of_the_fit_can_be_typeset(search: str) -> None:
    points = [point(0.4, 0.3), point(0.5, 0.4), point(0.6, 0.5)]
    figure = phase_diagram(boundary(points, search=search), [])
    figure.draw_without_rendering()


def test_the_title_states_what_the_axes_do_not() -> None:
    title = phase_diagram(boundary([]), []).axes[0].get_title()
    assert title == r"2 vesicles in shear flow, $\Delta A$ = 0.9, $\delta$ = 0.4"


# --- the history of a run ---

VISCOSITY = "viscosity_bending_tension"


def test_snapshots_are_spread_over_the_whole_run() -> None:
    _, axes = snapshots(run_figure(orbit()))
    times = snapshot_times(axes)
    assert times[0] == 0.0
    assert times[-1] == 40.0
    assert len(times) == 8
    assert np.ptp(np.diff(times)) <= 1.0  # frames are 1 apart


def test_a_run_of_few_frames_shows_each_once() -> None:
    run = orbit()
    frames = Frames(*(values[:3] for values in vars(run.frames).values()))
    _, axes = snapshots(run_figure(replace(run, frames=frames)))
    assert snapshot_times(axes) == [0.0, 1.0, 2.0]


def test_membranes_are_closed_and_of_the_shape_of_the_run() -> None:
    run = orbit()
    figure = run_figure(run)
    drawn = segments(figure)
    np.testing.assert_array_equal(drawn[..., 1, :], np.roll(drawn[..., 0, :], -1, axis=2))
    chord = np.linalg.norm(drawn[..., 1, :] - drawn[..., 0, :], axis=-1)
    np.testing.assert_allclose(chord, 2 * np.pi / 128, rtol=1e-3)  # so no segment joins two membranes

    index = [int(time) for time in snapshot_times(snapshots(figure)[1])]
    frames = run.frames
    exact = positions(frames.tangent_angle[index], frames.center[index], 2 * np.pi)
    drawn_points = np.swapaxes(drawn[:, :, ::2, 0], -1, -2)
    shift = drawn_points - exact
    np.testing.assert_allclose(shift, np.broadcast_to(shift[:, :1, :, :1], shift.shape), atol=1e-12)


def test_snapshots_are_centered_on_the_pair_below_their_times_and_do_not_touch() -> None:
    figure = run_figure(orbit())
    drawn = segments(figure)
    _, axes = snapshots(figure)
    middle = drawn.mean(axis=(1, 2, 3))
    np.testing.assert_allclose(middle[:, 0], [text.xy[0] for text in axes.texts], atol=1e-9)
    np.testing.assert_allclose(middle[:, 1], 0, atol=1e-9)
    x = drawn[..., 0].reshape(len(drawn), -1)
    assert np.all(x[1:].min(axis=1) > x[:-1].max(axis=1))


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0)], ids=["along", "across"])
def test_times_do_not_overlap_when_vesicles_drift_apart(direction: tuple[float, float]) -> None:
    run = orbit()
    time = 100.001 + run.frames.time
    distance = 2.6 + 30 * (run.frames.time[:, None, None] / 40) ** 4
    center = distance * np.array([[-0.5], [0.5]]) * direction
    figure = run_figure(replace(run, frames=replace(run.frames, time=time, center=center)))
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in snapshots(figure)[1].texts]
    assert len(boxes) == 8
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_membranes_have_equal_scales_in_x_and_y() -> None:
    figure = run_figure(orbit())
    figure.draw_without_rendering()
    _, axes = snapshots(figure)
    (x_scale, _), (_, y_scale) = axes.transData.transform([(1, 0), (0, 1)]) - axes.transData.transform((0, 0))
    assert x_scale == pytest.approx(y_scale, rel=1e-9)


def test_colors_are_the_tension() -> None:
    run = orbit()
    figure = run_figure(run)
    lines, axes = snapshots(figure)
    fine = 2 * np.pi * np.arange(129) / 128
    time = np.array(snapshot_times(axes))[:, None, None]
    at_ends = known_tension(fine, time, np.arange(2)[:, None])
    expected = ((at_ends[..., :-1] + at_ends[..., 1:]) / 2).ravel()
    np.testing.assert_allclose(lines.get_array(), expected, atol=1e-12)

    figure.draw_without_rendering()
    later = expected[2 * 128 :]
    low, high = later.min(), later.max()
    np.testing.assert_allclose(
        lines.get_colors(), TENSION_COLORS((expected - low) / (high - low)), atol=1 / 256
    )
    assert panel(figure, "tension").get_xlim() == pytest.approx((low, high))


@pytest.mark.parametrize(
    ("start", "extend"),
    [((-9.0, 0.5), "min"), ((0.5, 9.0), "max"), ((-9.0, 9.0), "both"), ((0.1, 0.9), "neither")],
)
def test_the_start_does_not_set_the_color_scale_and_the_bar_says_so(
    start: tuple[float, float], extend: str
) -> None:
    run = orbit()
    tension = np.broadcast_to((1 + np.cos(ALPHA)) / 2, run.frames.tension.shape).copy()
    low, high = start
    tension[0] = low + (high - low) * tension[0]
    figure = run_figure(replace(run, frames=replace(run.frames, tension=tension)))
    bar = snapshots(figure)[0].colorbar
    assert bar is not None
    assert (bar.vmin, bar.vmax) == pytest.approx((0, 1), abs=1e-3)
    assert bar.extend == extend


def test_a_tension_that_is_constant_to_rounding_shows_no_pattern() -> None:
    run = orbit()
    noise = 1e-12 * np.random.default_rng(1).standard_normal(run.frames.tension.shape)
    figure = run_figure(replace(run, frames=replace(run.frames, tension=0.7 + noise)))
    figure.draw_without_rendering()
    one_step = np.abs(np.diff(TENSION_COLORS(np.arange(256)), axis=0)).max()
    assert np.ptp(snapshots(figure)[0].get_colors(), axis=0).max() <= one_step


def test_frames_that_are_not_finite_are_passed_over() -> None:
    run = orbit()
    center = run.frames.center.copy()
    center[-3:] = np.nan
    figure = run_figure(replace(run, frames=replace(run.frames, center=center)))
    assert snapshot_times(snapshots(figure)[1])[-1] == 37.0
    assert np.isfinite(segments(figure)).all()


@pytest.mark.parametrize(
    ("run", "names"),
    [
        (orbit(), ("gap", "center_angle", "bending_energy", VISCOSITY)),
        (orbit(flow="trap"), ("gap", "center_angle", "bending_energy")),
        (orbit(flow=None, adhesion=False), ("gap", "center_angle", "bending_energy")),
        (orbit(vesicles=1, adhesion=False), ("inclination_angle", "bending_energy", VISCOSITY)),
        (orbit(vesicles=3, flow=None), ("gap", "bending_energy")),
        (orbit(vesicles=1, flow=None, adhesion=False), ("inclination_angle", "bending_energy")),
    ],
    ids=["shear", "trap", "no adhesion", "single in shear", "three", "single at rest"],
)
def test_panels_are_those_of_the_recorded_series(run: Run, names: tuple[str, ...]) -> None:
    figure = run_figure(run)
    assert [axes.get_label() for axes in figure.axes] == ["membranes", "tension", *names]
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes[2:]] + [figure.axes[1].get_tightbbox()]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_panels_show_the_series_and_angles_in_degrees() -> None:
    run = orbit()
    figure = run_figure(run)
    for name, factor in (("gap", 1.0), ("center_angle", 180 / np.pi)):
        line = panel(figure, name).lines[0]
        np.testing.assert_allclose(line.get_xdata(), run.series["time"])
        np.testing.assert_allclose(line.get_ydata(), factor * run.series[name])
    for name, parts in (
        ("bending_energy", ("bending_energy", "adhesion_energy")),
        (VISCOSITY, (VISCOSITY, "viscosity_adhesion")),
    ):
        for line, part in zip(panel(figure, name).lines, parts, strict=False):
            np.testing.assert_allclose(line.get_ydata(), run.series[part])


@pytest.mark.parametrize(("adhesion", "entries"), [(True, 2), (False, 1)])
def test_without_adhesion_there_is_no_adhesion_curve(adhesion: bool, entries: int) -> None:
    figure = run_figure(orbit(adhesion=adhesion))
    for name in ("bending_energy", VISCOSITY):
        legend = panel(figure, name).get_legend()
        assert legend is not None
        assert len(legend.get_texts()) == entries


def test_the_heading_names_scene_outcome_and_reason() -> None:
    run = replace(orbit(), outcome=Outcome.FAILED, failure="step below $1e-12 at t=40", period=None)
    figure = run_figure(run)
    first, second = figure.get_suptitle().split("\n")
    parameters = r"$\dot{\gamma}$ = 0.5, $\Delta A$ = 0.9, $\mathcal{H}$ = 1.5, $\delta$ = 0.4"
    assert first == f"2 vesicles in shear flow, {parameters}"
    assert second == r"failed at $t$ = 40: step below \$1e-12 at t=40"
    figure.draw_without_rendering()


# --- files ---

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


def test_vesicles_of_one_cluster_are_filled_with_one_color() -> None:
    figure = run_figure(suspension())
    axes = panel(figure, "membranes")
    (filled,) = (found for found in axes.collections if isinstance(found, PolyCollection))
    colors = filled.get_facecolor()
    assert len(filled.get_paths()) == len(colors) == 5  # of the last of three snapshots alone
    first, second = colors[0], colors[3]
    assert not np.array_equal(first, second)
    np.testing.assert_array_equal(colors, [first, first, first, second, second])
    middles = np.array([path.vertices[:-1].mean(axis=0) for path in filled.get_paths()])
    np.testing.assert_allclose(np.diff(middles, axis=0)[:, 1], [0, 3, 0, 0], atol=0.01)


def test_the_clusters_are_shown_over_time() -> None:
    run = suspension()
    figure = run_figure(run)
    drawn = {line.get_label(): line.get_ydata() for line in panel(figure, "clusters").get_lines()}
    np.testing.assert_array_equal(drawn["clusters"], run.series["clusters"])
    np.testing.assert_array_equal(drawn["largest"], run.series["largest_cluster"])


@pytest.mark.parametrize(("spread", "stacked"), [(1.0, False), (9.0, True)])
def test_wide_snapshots_are_drawn_below_each_other(spread: float, stacked: bool) -> None:
    run = suspension(spread)
    ends = segments(run_figure(run), vesicles=6, pieces=64)
    middles = ends.mean(axis=(1, 2, 3))
    assert len(middles) == 3
    along, across = (1, 0) if stacked else (0, 1)
    assert np.abs(np.diff(middles[:, along])).min() > 3
    np.testing.assert_allclose(middles[:, across], middles[0, across], atol=1e-9)


def test_many_different_numbers_are_given_by_their_ends() -> None:
    vesicles = tuple(
        Vesicle(reduced_area=0.7 + 0.05 * number, center=(3.0 * number, 0.0)) for number in range(5)
    )
    words = describe(Scene(horizon=1.0, vesicles=vesicles))
    assert "= 0.7 to 0.9" in words
    assert "0.75" not in words
    assert "0.7 and 0.75 and 0.8" in describe(Scene(horizon=1.0, vesicles=vesicles[:3]))
