"""Forces in recorded states: they balance, do the work that energies lose, and at rest are a pressure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import MembraneForces, Outcome, Run, Scene, membrane_forces, simulate
from solver.analysis.run import Frames
from solver.forces.adhesion import DirectAdhesion
from solver.forces.bending import Bending
from solver.membrane import curve
from solver.membrane.geometry import Geometry, Membranes
from solver.potentials.proximity import Closeness
from solver.scene import Numerics, PowerLaw, Shear, Vesicle
from tests.solver.scenes import closing, smooth_direction, uneven_pair

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def run() -> Run:
    """A second: two different vesicles in shear."""
    return simulate(uneven_pair(flow=Shear(rate=0.5), horizon=1.0, numerics=Numerics(points=96)))


@pytest.fixture(scope="module")
def forces(run: Run) -> MembraneForces:
    return membrane_forces(run.scene, run.frames)


def lengths(scene: Scene) -> Array:
    return np.array([vesicle.length for vesicle in scene.vesicles])


def points_of(scene: Scene, frames: Frames) -> Array:
    """(frames, vesicles, points, 2)."""
    return np.moveaxis(curve.positions(frames.tangent_angle, frames.center, lengths(scene)), -2, -1)


def sums(run: Run, force: Array) -> tuple[Array, Array]:
    """Force (frames, vesicles, 2) and torque (frames, vesicles) on each, over the magnitude of the force."""
    points = points_of(run.scene, run.frames)
    magnitude = np.abs(force).sum(axis=(2, 3))
    torque = points[..., 0] * force[..., 1] - points[..., 1] * force[..., 0]
    return force.sum(axis=2) / magnitude[..., None], torque.sum(axis=2) / magnitude


@pytest.mark.parametrize("kind", ["bending", "tension"])
def test_forces_of_a_membrane_on_itself_balance(run: Run, forces: MembraneForces, kind: str) -> None:
    force, torque = sums(run, getattr(forces, kind))
    assert np.abs(force).max() < 1e-10
    assert np.abs(torque).max() < 1e-5  # as far as the curve closes


def test_adhesion_balances_over_the_pair(run: Run, forces: MembraneForces) -> None:
    assert forces.adhesion is not None
    weighted = forces.adhesion * lengths(run.scene)[:, None, None]
    points, magnitude = points_of(run.scene, run.frames), np.abs(weighted).sum(axis=(1, 2, 3))
    torque = points[..., 0] * weighted[..., 1] - points[..., 1] * weighted[..., 0]
    assert np.abs(weighted.sum(axis=(1, 2)) / magnitude[:, None]).max() < 1e-6
    assert np.abs(torque.sum(axis=(1, 2)) / magnitude).max() < 1e-6
    assert np.abs(weighted[:, 0].sum(axis=1) / magnitude[:, None]).max() > 0.01


def test_forces_do_the_work_that_the_energies_lose(run: Run, forces: MembraneForces) -> None:
    """Along a deformation that does not stretch and keeps curves closed, against a difference of energies."""
    scene, last, step = run.scene, -1, 1e-3
    membranes = Membranes.of(scene.vesicles, run.frames.tangent_angle.shape[-1])
    state = membranes.pack(run.frames.tangent_angle[last], run.frames.center[last])
    direction = closing(membranes, state, smooth_direction(membranes))
    assert scene.adhesion is not None
    assert forces.adhesion is not None
    adhesion, bending = DirectAdhesion(scene.adhesion, 1e-10, membranes), Bending()
    around = [Geometry(membranes, state + k * step * direction) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    displacement = np.moveaxis(np.tensordot(weights, [g.points for g in around], axes=1), 0, -1)
    for force, energies in (
        (forces.bending, [bending.energy(g) for g in around]),
        (forces.adhesion, [adhesion.energy(g, Closeness(g)) for g in around]),
    ):
        work = np.sum(force[last] * displacement * membranes.spacing[:, None, None])
        assert work == pytest.approx(-weights @ energies, rel=1e-5)
        assert abs(work) > 0.1


def test_at_rest_all_forces_together_are_a_pressure() -> None:
    """A second: the fluid inside a membrane that does not move carries a constant pressure alone."""
    scene = Scene(
        horizon=500.0,
        vesicles=(
            Vesicle(reduced_area=0.9, center=(-1.0, 0.0)),
            Vesicle(reduced_area=0.85, length=5.0, center=(0.9, 0.2)),
        ),
        adhesion=PowerLaw(hamaker=1.0, distance=0.4),
    )
    run = simulate(scene)
    assert run.outcome is Outcome.EQUILIBRIUM
    found = membrane_forces(scene, run.frames)
    assert found.adhesion is not None
    force = (found.bending + found.tension + found.adhesion)[-1]
    tangents = np.moveaxis(curve.tangents(run.frames.tangent_angle[-1]), -2, -1)
    along = np.sum(force * tangents, axis=-1)
    inward = tangents[..., 0] * force[..., 1] - tangents[..., 1] * force[..., 0]
    of_each_kind = np.abs(found.bending[-1]).max()
    assert np.abs(along).max() < 2e-3 * of_each_kind
    assert np.ptp(inward, axis=-1).max() < 2e-3 * of_each_kind


def test_what_a_scene_does_not_have_is_none_and_what_is_not_finite_has_no_forces(run: Run) -> None:
    alone = run.scene.model_copy(update={"adhesion": None})
    assert membrane_forces(alone, run.frames).adhesion is None
    lost = replace(run.frames, center=np.full_like(run.frames.center, np.nan))
    found = membrane_forces(run.scene, lost)
    assert found.adhesion is not None
    assert np.isnan(found.adhesion).all()
    assert np.isnan(found.bending).all()
