"""What a simulation that was saved has come to so far, read from what it saved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.record import FRAMES, SERIES, VESICLE_SERIES, open_rows
from solver.analysis.run import Energy, Errors, Outcome, Run, RunResults, Work

if TYPE_CHECKING:
    from solver.analysis.record import Block, InMemory
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


def sample_so_far(saved: Saved) -> dict[str, float]:
    """Return the diagnostics that a simulation has recorded last.

    Parameters
    ----------
    saved : dict
        As `Simulation.saved` returned it.

    Returns
    -------
    dict of str to float
        By the name of their series; empty while the start relaxes.
    """
    return dict(saved["loop"]["recorder"]["sample"]) if saved["loop"] else {}


def open_blocks(saved: Saved) -> dict[str, Block]:
    """Return what a simulation has recorded and not given to its sink.

    Parameters
    ----------
    saved : dict
        As `Simulation.saved` returned it.

    Returns
    -------
    dict of str to dict of str to array
        By the part of the record.
    """
    if not saved["loop"]:
        return {}
    recorder = saved["loop"]["recorder"]
    blocks = {part: open_rows(recorder[f"_{part}"]) for part in (SERIES, VESICLE_SERIES, FRAMES)}
    return {part: rows for part, rows in blocks.items() if rows}


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
    for part, rows in open_blocks(saved).items():
        memory.take(part, rows)
    recorder = loop["recorder"]
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
