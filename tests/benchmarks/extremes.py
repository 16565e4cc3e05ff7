"""Random scenes over wide ranges: how many are fine, unresolved, or given up, and why.

``python -m tests.benchmarks.extremes [--count 200] [--seconds 10]`` runs them one after the other, prints a
line for each and a table at the end, and exits with 1 if one broke.  What the points do not resolve runs
again with ``points = "auto"``; what has a physical outcome runs again with a tenth of the tolerance and twice
the points, and must have the same.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from solver.analysis.run import LARGEST_SPATIAL, Outcome, Run
from solver.scene import Numerics, Scene
from solver.simulation.simulate import simulate
from tests.solver.random_scenes import objections, random_scenes

LARGEST_DRIFT = 1e-2  # of areas and closures
LARGEST_SUM = 0.1  # of local errors in time; beyond, an outcome is not called wrong if it changes


def verdict(run: Run) -> str:
    """In the words of `ensemble report stability`."""
    if run.outcome is Outcome.FAILED:
        return "refused"
    if not run.error.spatial <= LARGEST_SPATIAL:
        return "unresolved in space"
    if not max(run.error.area, run.error.closure) <= LARGEST_DRIFT:
        return "unresolved in time"
    return "fine"


def reason(run: Run) -> str:
    """Why a run was refused, without its numbers."""
    failure = run.failure or ""
    for phrase in (
        "do not resolve",
        "closer",
        "wall limit",
        "work limit",
        "no step size",
        "tension",
        "carried away",
        "finite",
        "relax",
    ):
        if phrase in failure:
            return phrase
    return failure


def with_numerics(scene: Scene, **changes: object) -> Scene:
    """The scene with other numerics."""
    numerics = Numerics.model_validate(scene.numerics.model_dump() | changes)
    return scene.model_copy(update={"numerics": numerics})


def finer(scene: Scene, run: Run) -> Scene:
    """The scene with a tenth of the tolerance, twice the points and work to spare."""
    numerics = scene.numerics
    return with_numerics(
        scene,
        tolerance=max(numerics.tolerance / 10, 1e-12),
        points=min(2 * (run.work.points or 64), 1024),
        integrator="auto",
        work_limit=10 * numerics.work_limit,
        wall_limit=4 * (numerics.wall_limit or 10.0),
    )


def main() -> None:
    """Run them, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="leave out the scenes before this one")
    parser.add_argument("--seconds", type=float, default=10.0, help="wall limit of a run")
    arguments = parser.parse_args()
    table: Counter[str] = Counter()
    broken = 0
    for name, scene in list(random_scenes(arguments.count, arguments.seconds))[arguments.first :]:
        try:
            run = simulate(scene)
            found = objections(run)
        except Exception as error:
            print(f"{name}: raised {type(error).__name__}: {error}", flush=True)
            broken += 1
            continue
        judged, checked = verdict(run), ""
        row = f"{judged}: {reason(run)}" if judged == "refused" else judged
        if "resol" in row and "time" not in row:
            again = simulate(with_numerics(scene, points="auto"))
            found += objections(again)
            row += f" → auto {verdict(again)}"
            checked = f"auto: {again.outcome} with {again.work.points} points, {again.failure or ''}"
        elif judged == "fine" and run.outcome is not Outcome.UNDECIDED:
            again = simulate(finer(scene, run))
            checked = f"finer: {again.outcome}, {again.failure or ''}"
            same = again.outcome in (run.outcome, Outcome.FAILED)
            if not same and run.error.temporal < LARGEST_SUM:
                found.append(f"with finer numerics it is {again.outcome}")
        table[row] += 1
        broken += bool(found)
        kind = scene.flow.kind if scene.flow else "rest"
        print(
            f"{name}: {kind}, {len(scene.vesicles)}: {run.outcome}, {row}; {run.failure or ''} "
            f"{checked} spatial {run.error.spatial:.1e} area {run.error.area:.1e} "
            f"temporal {run.error.temporal:.1e} {run.work.wall_seconds:.1f} s {'; '.join(found)}",
            flush=True,
        )
    for row, count in table.most_common():
        print(f"{count:4}  {row}")
    print(f"{broken:4}  broken")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
