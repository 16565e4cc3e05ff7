"""The figure of a run shows exactly its frames and series."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from ensemble.figures import run_figure
from ensemble.figures.style import TENSION_COLORS
from solver.analysis.run import Frames, Outcome, Run
from solver.membrane.curve import positions
from solver.scene import Units
from tests.ensemble.made_runs import (
    ALPHA,
    known_tension,
    orbit,
    panel,
    segments,
    snapshot_times,
    snapshots,
    suspension,
)

VISCOSITY = "viscosity_bending_tension"


def test_a_run_with_units_is_drawn_in_them() -> None:
    run = orbit()
    units = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")
    figure = run_figure(replace(run, scene=run.scene.model_copy(update={"units": units})))
    gap = panel(figure, "gap")
    np.testing.assert_allclose(
        gap.lines[0].get_xydata(), 10 * np.transpose([run.series["time"], run.series["gap"]])
    )
    assert gap.get_ylabel() == "gap (µm)"
    lines, axes = snapshots(figure)
    assert axes.texts[-1].get_text() == "$t$ = 400 s"
    plain = snapshots(run_figure(run))[0].get_array()
    np.testing.assert_allclose(lines.get_array(), plain)  # one is 1 nN/m
    assert panel(figure, "tension").get_xlabel() == r"tension $\sigma$ (nN/m)"
    heading = figure.get_suptitle()
    assert f"$t$ = {run.time:.4g} ({10 * run.time:.4g} s)" in heading


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
