"""What a simulation that was saved has come to so far, read from what it saved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.record import FRAMES, SERIES, VESICLE_SERIES, InMemory, open_rows
from solver.analysis.run import Energy, Errors, Outcome, Run, RunResults, Work

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.scene import Scene


def time_so_far(saved: Saved) -> float | None:
    """Return the time that a simulation has reached.

    Parameters
    ----------
    saved : dict
        As `Simulation.saved` returned it.

    Returns
    -------
    float or None
        None while the start relaxes.
    """
    return float(saved["loop"]["time"]) if saved["loop"] else None


def run_so_far(scene: Scene, saved: Saved, memory: InMemory) -> Run | None:
    """Return a run as far as it has come: undecided at the time reached, and without answers.

    Parameters
    ----------
    scene : Scene
    saved : dict
        As `Simulation.saved` returned it.
    memory : InMemory
        With the blocks that the sink had been given by then.  It takes the rest.

    Returns
    -------
    Run or None
        None while the start relaxes.
    """
    loop = saved["loop"]
    if not loop:
        return None
    recorder = loop["recorder"]
    for part in (SERIES, VESICLE_SERIES, FRAMES):
        rows = open_rows(recorder[f"_{part}"])
        if rows:
            memory.take(part, rows)
    sample = recorder["sample"]
    return memory.run(
        RunResults(
            scene=scene,
            outcome=Outcome.UNDECIDED,
            failure=None,
            undecided="the run has not ended",
            time=float(loop["time"]),
            period=None,
            effective_aspect_ratio=None,
            inclination_angle=None,
            gap=sample.get("gap"),
            viscosity=None,
            energy=Energy(sample["bending_energy"], sample.get("adhesion_energy")),
            error=Errors(
                area=recorder["largest"]["area_error"],
                closure=recorder["largest"]["closure_error"],
                temporal=loop["temporal_error"],
                spatial=recorder["spatial_error"],
            ),
            work=_work(saved),
            perturbations=tuple(loop["perturbations"]),
        )
    )


def _work(saved: Saved) -> Work:
    loop, segment = saved["loop"], saved["loop"]["segment"]
    before, equation, integrator = segment["before"], segment["equation"], segment["integrator"]
    evaluations, recordings, jacobians, factorizations, tension_iterations = before
    return Work(
        steps=loop["steps"],
        rejected_steps=loop["rejected_steps"],
        rhs_evaluations=(
            saved["start_evaluations"]
            + evaluations
            + recordings
            + equation["evaluations"]
            + equation["recordings"]
        ),
        jacobian_evaluations=jacobians + integrator["jacobian_evaluations"],
        factorizations=factorizations + integrator["factorizations"],
        tension_iterations=tension_iterations + equation["tension_iterations"],
        wall_seconds=saved["wall_seconds"],
        smallest_step=loop["smallest_step"],
        points=segment["points"],
    )
