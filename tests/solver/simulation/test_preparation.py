"""What processes compile together, before their runs, is all that a run compiles."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import gc, sys
from numba.core.dispatcher import Dispatcher
from solver.scene import Shear
from solver.simulation.preparation import compile_for
from solver.simulation.simulate import simulate
from tests.solver.scenes import uneven_pair

def ready():
    dispatchers = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {(each.py_func.__name__, str(types)) for each in dispatchers for types in each.overloads}

pair = uneven_pair(horizon=0.1, flow=Shear(rate=0.5))
one = pair.model_copy(update={"vesicles": pair.vesicles[:1], "adhesion": None})
scene = pair if "pair" in sys.argv else one
compile_for(scene, process=1)
before = ready()
assert before
simulate(scene)
print(*(name for name, _ in ready() - before))
"""


@pytest.mark.parametrize("vesicles", ["one", "pair"])
def test_no_function_is_left_for_the_run(vesicles: str) -> None:
    """Each takes about 1.5 s of processor time: a process starts anew."""
    program = [sys.executable, "-c", PROGRAM, vesicles]
    answer = subprocess.run(program, capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == ""
