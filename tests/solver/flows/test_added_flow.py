"""A flow that is added from outside runs end to end."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from solver.analysis.run import Outcome
from solver.dimensions import LENGTH
from solver.flows import FLOWS, ImposedFlow, Symbol
from solver.membrane.geometry import Membranes
from solver.membrane.symmetry import has_images
from solver.model import Positive
from solver.motion.terms import dense_equation
from solver.scene import Numerics, Scene
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import smooth_direction, uneven_pair

Array = NDArray[np.float64]


class Kolmogorov(ImposedFlow):
    """Velocity rate·(ℓ cos(y/ℓ), 0): fastest at y = 0, so that it is not odd."""

    kind: Literal["added-kolmogorov"] = "added-kolmogorov"
    length: Annotated[Positive, LENGTH] = 5.0

    title = "Kolmogorov flow"
    symbols = {"rate": Symbol("shear rate", r"\dot{\gamma}", "γ̇")}  # noqa: RUF012  as in its base

    def velocity(self, points: Array, centers: Array) -> Array:
        along = self.rate * self.length * np.cos(points[1] / self.length)
        return np.stack([along, np.zeros_like(along)])

    def velocity_gradient(self, points: Array) -> Array:
        gradient = np.zeros((2, *points.shape))
        gradient[0, 1] = -self.rate * np.sin(points[1] / self.length)
        return gradient


@pytest.fixture(autouse=True)
def kolmogorov() -> Iterator[None]:
    FLOWS.add(Kolmogorov)
    yield
    FLOWS.remove(Kolmogorov)


DOCUMENT = """
    horizon = 3.0
    vesicles = [{ center = [-1.6, 0.4] }, { center = [1.6, -0.4] }]
    flow = { kind = "added-kolmogorov", rate = 0.2, length = 4.0 }
"""


def test_documents_name_it() -> None:
    scene = Scene.model_validate(tomllib.loads(DOCUMENT))
    assert scene.flow == Kolmogorov(rate=0.2, length=4.0)
    assert Scene.model_validate_json(scene.model_dump_json(), strict=True) == scene
    with pytest.raises(ValidationError, match=r"(?s)flow.length.*greater than 0"):
        Scene.model_validate_json('{"horizon": 1, "flow": {"kind": "added-kolmogorov", "length": 0}}')


def test_a_pair_that_a_half_turn_leaves_as_it_is_moves_along() -> None:
    """Computed as one vesicle and its image, its center could not leave the origin."""
    scene = Scene.model_validate(tomllib.loads(DOCUMENT))
    assert not has_images(scene)
    assert has_images(scene.model_copy(update={"flow": None}))
    assert Membranes.of_scene(scene).multiplicity == 1
    run = simulate(scene)
    assert run.outcome is Outcome.UNDECIDED
    assert run.failure is None
    traveled = run.frames.center[-1].mean(axis=0) - run.frames.center[0].mean(axis=0)
    assert 0.5 * 0.2 * 4.0 * 3.0 < traveled[0] < 0.2 * 4.0 * 3.0  # slower than the fastest fluid
    assert abs(traveled[1]) < 0.01
    assert run.series.keys() >= {"gap", "center_angle"}
    assert not run.series.keys() & {"viscosity_bending_tension"}


def test_the_equation_of_motion_has_its_exact_jacobian() -> None:
    """Against fourth-order differences of the rate, along a smooth change of state."""
    scene = uneven_pair(flow=Kolmogorov(rate=0.4), numerics=Numerics(points=96, tolerance=1e-9))
    equation, state, step = dense_equation(scene), placed_state(scene), 1e-3
    direction = smooth_direction(equation.membranes)
    rates = [equation.rate(state + k * step * direction) for k in (-2, -1, 1, 2)]
    exact = np.array([1, -8, 8, -1]) @ np.array(rates) / (12 * step)
    claimed = equation.jacobian(state) @ direction
    np.testing.assert_allclose(claimed, exact, rtol=0, atol=1e-7 * np.max(np.abs(exact)))


def test_it_is_unknown_once_removed() -> None:
    FLOWS.remove(Kolmogorov)
    try:
        with pytest.raises(ValidationError, match=r"'added-kolmogorov'.*expected tags: 'shear'"):
            Scene.model_validate(tomllib.loads(DOCUMENT))
    finally:
        FLOWS.add(Kolmogorov)
