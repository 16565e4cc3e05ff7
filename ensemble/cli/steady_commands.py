"""Commands that compute steady states and branches of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from ensemble.cli.options import AsJson, Changes, Document, NoStore, StorePath
from ensemble.cli.printing import print_answer
from ensemble.config.defaults import DEFAULT_STORE
from ensemble.errors import refusing
from ensemble.mpi.world import launched_rank

if TYPE_CHECKING:
    from ensemble.questions import Answer


def steady(  # numpydoc ignore=PR01
    scene: Document,
    changes: Changes = [],  # noqa: B006  typer copies it
    store: StorePath = DEFAULT_STORE,
    no_store: NoStore = False,
    as_json: AsJson = False,
) -> None:
    """Compute the steady state to which a scene comes, and whether it is stable.

    It starts from the end of the scene's run.  Of a pair that revolves it tells whether the motion to which
    it has settled is stable against what breaks its symmetry.  The exit status is 4 if there is no steady
    state or the motion has not settled.
    """
    from ensemble.config.documents import load_scene
    from ensemble.questions.branches import (
        require_steady_states,
        revolves,
        settled_answer,
        steady_answer,
    )
    from solver.simulation.broken_symmetry import require_image

    with refusing():
        loaded = load_scene(scene, changes)
        turns = revolves(loaded)
        (require_image if turns else require_steady_states)(loaded)
    answer = settled_answer if turns else steady_answer
    _print(lambda: answer(loaded, None if no_store else store), as_json)


def follow(  # numpydoc ignore=PR01
    scene: Document,
    parameter: Annotated[
        str, typer.Option(metavar="PATH", help="The number of the scene that changes: a dotted path.")
    ],
    to: Annotated[
        float | None, typer.Option(help="Value at which it ends; left out, it rises as far as it goes.")
    ] = None,
    changes: Changes = [],  # noqa: B006
    store: StorePath = DEFAULT_STORE,
    no_store: NoStore = False,
    as_json: AsJson = False,
) -> None:
    """Follow a steady state as a parameter changes, through folds, and find where it becomes unstable.

    It starts from the end of the scene's run.  The branch ends at the given value, where it comes back to its
    first one, or where the scene allows no more.  The exit status is 4 if there is no steady state.
    """
    from ensemble.config.documents import load_scene
    from ensemble.questions.branches import BranchQuestion

    with refusing():
        question = BranchQuestion(load_scene(scene, changes), parameter, to)
    _print(lambda: question.answer(None if no_store else store), as_json)


def _print(answer_of: Callable[[], Answer], as_json: bool) -> None:
    """Print an answer that the first rank computes alone, and exit."""
    if launched_rank() != 0:
        raise typer.Exit
    print_answer(answer_of(), as_json)
