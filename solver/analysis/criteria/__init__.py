"""When a run is decided, and how: one outcome criterion a module.  `solver/README.md` says how to add one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.completed import Completed
from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.criteria.revolved import Revolved
from solver.analysis.criteria.separated import Separated
from solver.analysis.criteria.steady import Steady
from solver.analysis.criteria.tumbled import Tumbled

if TYPE_CHECKING:
    from solver.scene import Scene

# In the order in which they are asked; the first one with an answer decides.
CRITERIA: list[type[Criterion]] = [Separated, Tumbled, Revolved, Steady, Completed]


def criteria_for(scene: Scene) -> tuple[Criterion, ...]:
    """Return the criteria that apply to a scene, in the order in which they are asked.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Criterion
    """
    return tuple(criterion(scene) for criterion in CRITERIA if criterion.applies_to(scene))


__all__ = ["CRITERIA", "Criterion", "History", "criteria_for"]
