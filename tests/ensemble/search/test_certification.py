"""Certified brackets depend on the physics at both numerics alone, and only their own runs are added."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.documents import load_study
from ensemble.config.geometric_grid import GeometricGrid
from ensemble.search.certification import Certification, CertificationResult
from ensemble.search.critical_value import Side
from solver.scene import Numerics

GRID = GeometricGrid(0.05)
LIMITS = (0.05, 5.0)
INDICES = GRID.within(*LIMITS)

Physics = Callable[[int], Side]  # the side of the value at a grid index, at the finer numerics

indices = st.integers(INDICES[0], INDICES[-1])


def certification(low: int) -> Certification:
    return Certification(GRID, LIMITS, (GRID.value(low), GRID.value(low + 1)))


def finish(certifying: Certification, physics: Physics, workers: int = 1, order: Random | None = None) -> int:
    """Certify to the end; with an order answers arrive in it and some are lost.  The number of answers."""
    pending: list[float] = []
    answers = 0
    while not certifying.done:
        while len(pending) < workers and (value := certifying.ask()) is not None:
            pending.append(value)
        assert pending, "a certification that is not done must have asked for something"
        value = pending.pop(0 if order is None else order.randrange(len(pending)))
        if order is not None and order.random() < 0.2:
            certifying.withdraw(value)
        else:
            certifying.tell(value, physics(GRID.index(value)))
            answers += 1
    assert certifying.ask() is None
    assert certifying.unneeded() == frozenset(pending)
    return answers


def expected(low: int, physics: Physics) -> tuple[CertificationResult, tuple[float, float] | None]:
    """What the physics says, by looking at every value."""
    lows = [index for index in INDICES if index <= low and physics(index) is Side.LOW]
    highs = [index for index in INDICES if index > low and physics(index) is Side.HIGH]
    if not lows or not highs:
        return CertificationResult.UNCERTIFIED, None
    bracket = (GRID.value(lows[-1]), GRID.value(highs[0]))
    reversed_below = any(physics(index) is Side.HIGH for index in range(lows[-1], low + 1))
    reversed_above = any(physics(index) is Side.LOW for index in range(low + 1, highs[0]))
    return (
        CertificationResult.NON_MONOTONE
        if reversed_below and reversed_above
        else CertificationResult.CONVERGED
    ), bracket


@st.composite
def any_physics(draw: st.DrawFn) -> Physics:
    """A threshold, a zone without answers, and values with any answer at all."""
    first_high = draw(st.integers(INDICES[0], INDICES[-1] + 1))
    zone = range(first_high - draw(st.integers(0, 12)), first_high + draw(st.integers(0, 12)))
    odd = draw(st.dictionaries(indices, st.sampled_from(Side), max_size=20))

    def side(index: int) -> Side:
        if index in odd:
            return odd[index]
        if index in zone:
            return Side.UNDECIDED
        return Side.LOW if index < first_high else Side.HIGH

    return side


@given(
    low=st.integers(INDICES[0], INDICES[-1] - 1),
    physics=any_physics(),
    workers=st.integers(1, 4),
    order=st.none() | st.randoms(use_true_random=False),
    told=st.sets(indices, max_size=10),
)
def test_result_and_bracket_depend_on_the_physics_alone(
    low: int, physics: Physics, workers: int, order: Random | None, told: set[int]
) -> None:
    certifying = certification(low)
    for index in told:
        certifying.tell(GRID.value(index), physics(index))
    finish(certifying, physics, workers, order)
    assert (certifying.result, certifying.bracket) == expected(low, physics)


@pytest.mark.parametrize(
    ("shift", "bracket", "answers"),
    [(0, (10, 11), 2), (-1, (9, 11), 3), (-3, (7, 11), 5), (2, (10, 13), 4)],
)
def test_a_shifted_threshold_widens_the_bracket_on_its_side_only(
    shift: int, bracket: tuple[int, int], answers: int
) -> None:
    certifying = certification(10)
    made = finish(certifying, lambda index: Side.LOW if index < 11 + shift else Side.HIGH)
    assert certifying.result is CertificationResult.CONVERGED
    assert certifying.bracket == tuple(map(GRID.value, bracket))
    assert made == answers


def test_an_end_without_an_answer_moves_on() -> None:
    silent = {10: Side.FAILED, 9: Side.UNDECIDED}
    certifying = certification(10)
    finish(certifying, lambda index: silent.get(index, Side.LOW if index < 11 else Side.HIGH))
    assert certifying.result is CertificationResult.CONVERGED
    assert certifying.bracket == (GRID.value(8), GRID.value(11))


def test_both_ends_are_tried_at_once_and_a_lost_end_makes_the_other_unneeded() -> None:
    certifying = certification(INDICES[0])
    low, high = certifying.ask(), certifying.ask()
    assert (low, high) == (GRID.value(INDICES[0]), GRID.value(INDICES[1]))
    assert certifying.ask() is None
    assert certifying.ends_left == 2
    assert low is not None
    certifying.tell(low, Side.HIGH)
    assert certifying.result is CertificationResult.UNCERTIFIED
    assert certifying.unneeded() == {high}


@pytest.mark.parametrize(("points", "finer"), [(64, 96), (50, 76), (16, 24)])
def test_finer_means_half_as_many_points_more_and_a_hundredth_of_the_tolerance(
    points: int, finer: int
) -> None:
    changes = [f"scene.numerics.points={points}", "scene.numerics.tolerance=1e-3"]
    scene = load_study("critical-hamaker", changes).scene
    fine = certifying_scene(scene)
    assert fine.numerics == Numerics(points=finer, tolerance=1e-5)
    assert fine.model_copy(update={"numerics": scene.numerics}) == scene


def test_points_that_the_tolerance_chooses_are_left_to_the_finer_one() -> None:
    scene = load_study("critical-hamaker", ["scene.numerics.points=auto", "search.certify=true"]).scene
    numerics = certifying_scene(scene).numerics
    assert numerics == Numerics(points="auto", tolerance=scene.numerics.tolerance / 100)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ("scene.numerics.points=1024", "numerics.points: 1536"),
        ("scene.numerics.tolerance=1e-12", "numerics.tolerance"),
    ],
)
def test_numerics_that_cannot_be_finer_are_refused_at_once(ensemble, tmp_path, change: str, field: str):
    assert not load_study("critical-hamaker", [change]).search.certify
    result = ensemble("bisect", "--certify", f"--set={change}", "--store=store", cwd=tmp_path)
    assert result.returncode == 2
    assert field in result.stderr
    assert list(tmp_path.iterdir()) == []
