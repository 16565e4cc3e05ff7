"""Every potential: its minimum, its derivatives, alike in compiled loops; and one that is added in a test."""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from solver.analysis.run import Outcome
from solver.forces.adhesion import DirectAdhesion
from solver.forces.coarsened_adhesion import CoarsenedAdhesion
from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_forces, add_stiffnesses, pair_energy
from solver.membrane.geometry import Geometry, Membranes
from solver.model import Positive
from solver.pair_potentials import PAIR_POTENTIALS, PairPotential, PowerLaw
from solver.pair_potentials.pair_potential import Derivatives, Formula
from solver.parallel import SERIAL
from solver.potentials.neighbors import Neighbors
from solver.potentials.proximity import Closeness, Proximity
from solver.scene import LARGEST_DENSE, Numerics, Scene
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import smooth_direction, uneven_pair
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]

DISTANCE, CUTOFF = 0.4, 1.1
COMMON: dict[str, Any] = {"hamaker": 1.5, "distance": DISTANCE}


def morse(square: float, parameters: tuple[float, float]) -> Derivatives:
    """Return φ/H and its first and second derivative by r²."""
    distance, steepness = parameters
    r = math.sqrt(square)
    attraction = math.exp(-steepness * (r - distance))
    repulsion = attraction * attraction
    slope = -2 * steepness * (repulsion - attraction)
    curvature = 2 * steepness * steepness * (2 * repulsion - attraction)
    return repulsion - 2 * attraction, slope / (2 * r), (curvature - slope / r) / (4 * square)


class Morse(PairPotential):
    """φ = H[exp(−2a(r − δ)) − 2 exp(−a(r − δ))] with the steepness a."""

    kind: Literal["added-morse"] = "added-morse"
    steepness: Positive = 4.0

    @property
    def formula(self) -> Formula:
        return morse

    @property
    def parameters(self) -> tuple[float, float]:
        return self.distance, self.steepness


def test_the_guide_adds_this_potential() -> None:
    guide = (Path(__file__).parents[3] / "solver" / "README.md").read_text(encoding="utf-8")
    for part in (morse, Morse):
        source = inspect.getsource(part).replace("added-morse", "morse")  # which may be registered one day
        assert textwrap.indent(source, "   ") in guide


@pytest.fixture
def registered() -> Iterator[None]:
    PAIR_POTENTIALS.add(Morse)
    yield
    PAIR_POTENTIALS.remove(Morse)


EXPONENTS = [(3, 2), (4, 2), (12, 6), (7, 3), (12, 5), (24, 12), (127, 126)]
POTENTIALS = [
    *(potential(**COMMON) for potential in (*PAIR_POTENTIALS, Morse)),
    *(PowerLaw(**COMMON, exponents=exponents) for exponents in EXPONENTS),
]
every_potential = pytest.mark.parametrize(
    "potential",
    [p.model_copy(update={"cutoff": cutoff}) for p in POTENTIALS for cutoff in (None, CUTOFF)],
    ids=lambda p: f"{p.kind} {getattr(p, 'exponents', '')} {p.cutoff or ''}".strip(),
)


@every_potential
def test_its_least_value_is_at_the_distance(potential: PairPotential) -> None:
    value, first, second = potential.evaluate(DISTANCE**2)
    assert value < 0
    assert abs(first) < 1e-12 * second * DISTANCE**2
    for r in (0.7 * DISTANCE, 0.99 * DISTANCE, 1.01 * DISTANCE, 1.5 * DISTANCE, 1.0):
        assert potential.evaluate(r * r)[0] > value


@every_potential
@pytest.mark.parametrize("r", [0.35, 0.45, 0.8, 1.05])
def test_its_derivatives_are_exact(potential: PairPotential, r: float) -> None:
    square, step = r * r, 1e-5 * r * r
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    around = np.array([potential.evaluate(square + k * step) for k in (-2, -1, 1, 2)])
    _, first, second = potential.evaluate(square)
    scale = np.abs(around).max(axis=0)
    assert weights @ around[:, 0] == pytest.approx(first, rel=1e-8, abs=1e-9 * scale[0] / square)
    assert weights @ around[:, 1] == pytest.approx(second, rel=1e-8, abs=1e-9 * scale[1] / square)


@every_potential
def test_compiled_loops_sum_the_same(potential: PairPotential) -> None:
    """Over so many sources that both the SIMD part of the loops and their remainder are reached."""
    random = np.random.default_rng(1)
    targets, sources = random.uniform(-0.5, 0.5, (2, 3)), random.uniform(-0.5, 0.5, (2, 37)) + 0.9
    weights = random.uniform(0.5, 1.5, 37)
    law = formula_and_parameters(potential)
    offsets = targets[:, :, None] - sources[:, None]
    terms = np.array([[potential.evaluate(q) for q in row] for row in np.sum(offsets**2, axis=0)])
    value, first, second = np.moveaxis(terms, -1, 0) * weights
    force, stiffness = np.zeros((2, 3)), np.zeros((3, 3))
    add_forces(*law, targets, sources, weights, potential.hamaker, force)
    add_stiffnesses(*law, targets, sources, weights, potential.hamaker, stiffness)
    x, y = offsets
    expected = -2 * potential.hamaker * np.sum(first * offsets, axis=-1)
    slopes = (first + 2 * second * x * x, 2 * second * x * y, first + 2 * second * y * y)
    derivative = -2 * potential.hamaker * np.sum(slopes, axis=-1)
    assert pair_energy(*law, targets, sources, weights) == pytest.approx(value.sum(), rel=1e-12)
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))
    np.testing.assert_allclose(stiffness, derivative, rtol=0, atol=1e-12 * np.max(np.abs(derivative)))


# --- A scene with a potential that is not part of the project ---------------------------------------------


def document(scene: Scene, **adhesion: Any) -> Scene:
    """The scene with adhesion as a document describes it."""
    return Scene.model_validate(scene.model_dump() | {"adhesion": {**COMMON, **adhesion}})


@pytest.mark.parametrize("cutoff", [None, CUTOFF])
@pytest.mark.parametrize(
    "scene",
    [uneven_pair(horizon=0.3), suspension(LARGEST_DENSE + 1, horizon=0.3)],
    ids=["pair", "many"],
)
@pytest.mark.usefixtures("registered")
def test_a_new_potential_runs(scene: Scene, cutoff: float | None) -> None:
    scene = document(scene, kind="added-morse", steepness=3.0, cutoff=cutoff)
    assert scene.adhesion == Morse(**COMMON, steepness=3.0, cutoff=cutoff)
    assert Scene.model_validate_json(scene.model_dump_json()) == scene
    run = simulate(scene)
    assert run.outcome in {Outcome.UNDECIDED, Outcome.COMPLETED}
    assert run.energy.adhesion is not None
    assert run.energy.adhesion < 0
    without = simulate(scene.model_copy(update={"adhesion": None}))
    assert np.max(np.abs(run.frames.center[-1] - without.frames.center[-1])) > 1e-3


@pytest.mark.parametrize("form", ["direct", "cutoff", "coarsened"])
def test_the_force_of_a_new_potential_is_minus_the_gradient_of_its_energy(form: str) -> None:
    """Work done along a deformation without stretching, against a fourth-order difference of the energy."""
    potential = Morse(**COMMON, cutoff=CUTOFF if form == "cutoff" else None)
    scene = uneven_pair(adhesion=None, numerics=Numerics(points=128))
    membranes, state, step = Membranes.of_scene(scene), placed_state(scene), 1e-3
    adhesion: DirectAdhesion | CoarsenedAdhesion = DirectAdhesion(potential, 1e-10, membranes)
    if form == "coarsened":
        adhesion = CoarsenedAdhesion(potential, 1e-10, SERIAL)

    def closeness(geometry: Geometry) -> Proximity:
        return Neighbors(geometry, adhesion.reach) if form == "coarsened" else Closeness(geometry)

    direction = smooth_direction(membranes)
    around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    energy_change = weights @ [adhesion.energy(geometry, closeness(geometry)) for geometry in around]
    displacement = np.tensordot(weights, [geometry.points for geometry in around], axes=1)
    geometry = Geometry(membranes, state)
    force = adhesion.density(geometry, closeness(geometry))
    work = np.sum(force * displacement * membranes.spacing[:, None])
    assert work == pytest.approx(-energy_change, rel=1e-6)
    assert abs(work) > 0.05


# --- Documents ------------------------------------------------------------------------------------------


def test_a_document_without_a_kind_means_the_power_law() -> None:
    assert document(uneven_pair()).adhesion == PowerLaw(**COMMON)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "yukawa"}, "'power-law'"),
        ({"exponents": [2, 4]}, "m > n >= 2"),
        ({"exponents": [128, 2]}, "at most 127"),
        ({"cutoff": 0.4}, "cutoff must be more than the distance 0.4"),
        ({"steepness": 1.0}, "steepness"),
    ],
)
def test_a_document_that_is_wrong_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        document(uneven_pair(), **fields)
