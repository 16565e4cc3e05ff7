"""The guides of `solver/README.md` work as printed: their code is registered and used in a run.

Those of pair potentials and integrators are followed by the tests of these.
"""

from __future__ import annotations

import importlib.util
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from solver import Outcome, Scene, simulate
from solver.analysis.criteria import CRITERIA
from solver.flows import FLOWS
from solver.membrane.symmetry import has_images

ROOT = Path(__file__).parents[2]


def guide(title: str) -> str:
    """The first block of Python below a heading."""
    text = (ROOT / "solver" / "README.md").read_text()
    found = re.search(rf"^### {title}$.*?^( *)```python\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL)
    assert found
    return textwrap.dedent(found[2])


@pytest.fixture
def printed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ModuleType]:
    """The module that a guide prints, imported from a file.

    Its kind is another one, so that the guide's flow may be added to those that there are.
    """
    name = f"printed_{request.node.name}"
    file = tmp_path / f"{name}.py"
    file.write_text(guide(request.param).replace('"kolmogorov"', '"printed-kolmogorov"'))
    specification = importlib.util.spec_from_file_location(name, file)
    assert specification
    assert specification.loader
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules[name]


@pytest.mark.parametrize("printed", ["Add a flow"], indirect=True)
def test_a_flow(printed: ModuleType) -> None:
    """A vesicle off the axis drifts toward the axis, and a pair is not halved."""
    flow = {"kind": "printed-kolmogorov", "rate": 1.0, "length": 4.0}
    FLOWS.add(printed.Kolmogorov)
    try:
        vesicle = {"reduced_area": 0.9, "center": [0.0, 1.5]}
        numerics = {"points": 32, "tolerance": 1e-3}
        run = simulate(Scene(horizon=5.0, vesicles=[vesicle], flow=flow, numerics=numerics))
        pair = Scene(horizon=5.0, vesicles=[{"center": [-1.5, 0.0]}, {"center": [1.5, 0.0]}], flow=flow)
    finally:
        FLOWS.remove(printed.Kolmogorov)
    assert run.outcome is Outcome.UNDECIDED
    assert np.abs(run.frames.center[-1, 0, 1]) < 1.5
    assert run.frames.center[-1, 0, 0] > 10.0
    assert not has_images(pair)


@pytest.mark.parametrize("printed", ["Add an outcome criterion"], indirect=True)
def test_an_outcome_criterion(printed: ModuleType) -> None:
    """It ends a run of an adhering pair long before the pair is at rest."""
    scene = Scene(
        horizon=40.0,
        vesicles=[{"center": [-0.95, 0.0]}, {"center": [0.95, 0.0]}],
        adhesion={"hamaker": 1.0, "distance": 0.4},
        numerics={"points": 32, "tolerance": 1e-3},
    )
    usual = simulate(scene)
    CRITERIA.insert(0, printed.StaysInContact)
    try:
        run = simulate(scene)
    finally:
        CRITERIA.remove(printed.StaysInContact)
    assert run.outcome is Outcome.BOUND
    assert 5.0 <= run.time < 10.0
    assert usual.outcome is not Outcome.BOUND
    assert usual.time > run.time
