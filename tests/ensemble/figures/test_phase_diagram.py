"""Phase diagrams show exactly the brackets and runs that they are given."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from ensemble.figures import phase_diagram
from ensemble.figures.style import CONFIGURATION_MARKS, MARKS
from ensemble.figures.symbols import describe
from ensemble.search.boundary import Boundary, BoundaryPoint
from solver.analysis.run import Configuration, Outcome
from solver.scene import Scene, Units, Vesicle
from tests.ensemble.made_runs import artist, scene


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


SHEAR_RATE = r"shear rate, $\dot{\gamma}$"
EXTENSION_RATE = r"extension rate, $\dot{\epsilon}$"


UNITS = Units(radius="10 um", bending_modulus="1e-19 J", viscosity="1 mPa*s")


def test_axes_have_the_units_of_the_scene_if_they_are_known() -> None:
    traced = boundary([point(1.0, 0.7), point(2.0, 1.4), point(3.0, 2.1)]).in_units(UNITS)
    axes = phase_diagram(traced, [(1.0, 0.7, Outcome.BOUND)]).axes[0]
    assert axes.get_xlabel() == f"{SHEAR_RATE} (1/s)"
    assert axes.get_ylabel().endswith(" (µPa)")
    for gid in ("run bound", "boundary", "fit"):
        drawn = artist(axes, gid)
        assert (drawn.get_xdata()[0], drawn.get_ydata()[0]) == pytest.approx((0.1, 70.0))
    assert "700 " in artist(axes, "fit").get_label()
    ends = artist(axes, "bracket").get_segments()[0][:, 1]
    assert ends == pytest.approx([70 / 1.25, 70 * 1.25])
    assert r"$\delta$ = 0.4 (4 µm)" in axes.get_title()


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
    assert set(CONFIGURATION_MARKS) == set(Configuration)
    looks = {(mark.color, mark.shape) for marks in (MARKS, CONFIGURATION_MARKS) for mark in marks.values()}
    assert len(looks) == len({*Outcome, *Configuration})  # tumbling is one of each


def test_bars_span_the_brackets_and_open_brackets_have_none() -> None:
    points = [point(1.0, 0.7), point(0.5, 0.36), point(0.75, 0.5, bracket=(0.4, None), status="open")]
    axes = phase_diagram(boundary(points), []).axes[0]
    expected = [[(0.5, 0.36 / 1.25), (0.5, 0.36 * 1.25)], [(1.0, 0.7 / 1.25), (1.0, 0.7 * 1.25)]]
    np.testing.assert_allclose(artist(axes, "bracket").get_segments(), expected, rtol=1e-14)


def test_every_other_change_of_the_outcome_has_a_bar() -> None:
    changes = [
        {"bracket": bracket, "outcomes": outcomes}
        for bracket, outcomes in [
            ((0.10, 0.11), ("separated", "bound")),
            ((0.20, 0.21), ("bound", "separated")),
            ((0.34, 0.36), ("separated", "bound")),
        ]
    ]
    answer = point(0.5, 0.35, bracket=(0.34, 0.36), status="non-monotone", changes=changes)
    figure = phase_diagram(boundary([answer, point(1.0, 0.7)]), [])
    bars = artist(figure.axes[0], "other change").get_segments()
    np.testing.assert_allclose(bars, [[(0.5, 0.10), (0.5, 0.11)], [(0.5, 0.20), (0.5, 0.21)]], rtol=1e-14)
    assert "another change of the outcome" in [text.get_text() for text in figure.legends[0].get_texts()]


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
    sweep, critical = [0.25, 0.5, 1.0, 1.5], [0.20, 0.36, 0.70, 1.02]
    points = [point(x, y) for x, y in zip(sweep, critical, strict=True)]
    stray = point(2.0, 9.0, status="open")
    axes = phase_diagram(boundary([*points, stray]), []).axes[0]
    assert fitted(artist(axes, "fit")) == pytest.approx(tuple(np.polyfit(sweep, critical, 1)), rel=1e-10)


def test_two_points_are_not_fitted() -> None:
    axes = phase_diagram(boundary([point(0.5, 0.36), point(1.0, 0.7)]), []).axes[0]
    assert not axes.findobj(lambda candidate: candidate.get_gid() == "fit")


def test_points_that_lie_on_a_curve_are_not_fitted() -> None:
    rates = {0.75: 0.113, 0.8: 0.094, 0.85: 0.077, 0.9: 0.063, 0.95: 0.051}  # of the trap at H = 0.7
    points = [point(area, rate) for area, rate in rates.items()]
    axes = phase_diagram(boundary(points), []).axes[0]
    assert not axes.findobj(lambda candidate: candidate.get_gid() == "fit")


def test_certified_brackets_look_different() -> None:
    points = [point(0.5, 0.36, certified=True), point(1.0, 0.7)]
    figure = phase_diagram(boundary(points), [])
    certified, other = (artist(figure.axes[0], name) for name in ("certified bracket", "bracket"))
    assert [each[0][0] for each in certified.get_segments()] == [0.5]
    assert [each[0][0] for each in other.get_segments()] == [1.0]
    assert certified.get_linewidth() > 2 * other.get_linewidth()
    assert {"certified bracket", "bracket"} < {text.get_text() for text in figure.legends[0].get_texts()}


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


def test_many_different_numbers_are_given_by_their_ends() -> None:
    vesicles = tuple(
        Vesicle(reduced_area=0.7 + 0.05 * number, center=(3.0 * number, 0.0)) for number in range(5)
    )
    words = describe(Scene(horizon=1.0, vesicles=vesicles))
    assert "= 0.7 to 0.9" in words
    assert "0.75" not in words
    assert "0.7 and 0.75 and 0.8" in describe(Scene(horizon=1.0, vesicles=vesicles[:3]))


def test_the_legend_of_a_narrow_figure_stands_below_it() -> None:
    points = boundary([point(0.5, 0.36), point(1.0, 0.7)])
    for width, is_below in ((7.2, False), (3.4, True)):
        figure = phase_diagram(points, [], width)
        figure.draw_without_rendering()
        (axes,), (legend,) = figure.axes, figure.legends
        box = legend.get_window_extent()
        assert (box.y1 < axes.get_window_extent().y0) == is_below
        assert (box.x0 > axes.get_window_extent().x1) == (not is_below)
