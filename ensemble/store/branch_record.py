"""A branch of steady states as files hold it: a summary and arrays with named dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ensemble.search.branch_summary import BranchPointRecord, BranchSummary, branch_key
from ensemble.store.run_record import NamedArray
from ensemble.store.versions import result_versions
from ensemble.timestamp import now
from solver.revision import RESULTS_REVISION

if TYPE_CHECKING:
    from solver.scene import Scene
    from solver.simulation.steady_scenes import SteadyBranch


def summary_of(scene: Scene, parameter: str, to: float | None, branch: SteadyBranch) -> BranchSummary:
    """Summarize a branch that this process has just followed.

    Parameters
    ----------
    scene : Scene
    parameter : str
    to : float or None
    branch : SteadyBranch

    Returns
    -------
    BranchSummary
    """
    points, folds, crossings = (
        tuple(map(BranchPointRecord.of, part)) for part in (branch.points, branch.folds, branch.crossings)
    )
    return BranchSummary(
        key=branch_key(scene, parameter, to),
        created=now(),
        versions=result_versions(),
        results_revision=RESULTS_REVISION,
        scene=scene,
        parameter=parameter,
        to=to,
        ended=branch.ended,
        branch=points,
        folds=folds,
        crossings=crossings,
    )


def branch_arrays(branch: SteadyBranch) -> dict[str, NamedArray]:
    """Return the arrays of a branch by name.

    Parameters
    ----------
    branch : SteadyBranch

    Returns
    -------
    dict of str to NamedArray
        ``parameter`` over the points, and the shapes; the same of folds and crossings with a prefix.
    """
    arrays = dict[str, NamedArray]()
    parts = {"": branch.points, "fold_": branch.folds, "crossing_": branch.crossings}
    for prefix, points in parts.items():
        if not points:
            continue
        shapes = [point.state.shapes for point in points]
        values = (
            np.array([point.parameter for point in points]),
            np.array([shape.tangent_angle for shape in shapes]),
            np.array([shape.center for shape in shapes]),
        )
        for (name, dimensions), array in zip(branch_dimensions(prefix).items(), values, strict=True):
            arrays[name] = NamedArray(dimensions, array)
    return arrays


def branch_dimensions(prefix: str) -> dict[str, tuple[str, ...]]:
    """Return the names of the arrays of a part of a branch, with their dimensions.

    Parameters
    ----------
    prefix : str
        ``fold_``, ``crossing_``, or empty for the points.

    Returns
    -------
    dict of str to tuple of str
        The parameter, the tangent angles and the centers.
    """
    over = f"{prefix}parameter"
    return {
        over: (over,),
        f"{prefix}tangent_angle": (over, "vesicle", "point"),
        f"{prefix}center": (over, "vesicle", "axis"),
    }
