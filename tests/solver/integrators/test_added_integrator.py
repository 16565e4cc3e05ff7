"""An integrator is one module and one name: those that there are, and one that is added as the guide says."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from solver import simulate
from solver.integrators.bdf import backward_differentiation
from solver.integrators.integrator import FACTORIES, register, unregister
from solver.scene import Numerics
from solver.scene.numerics import INTEGRATORS
from tests.solver.scenes import shear_pair
from tests.solver.steps import amplification, oscillator_errors

Array = NDArray[np.float64]

GUIDE = Path(__file__).parents[3] / "solver" / "README.md"


def example() -> str:
    """The module that the guide writes."""
    section = GUIDE.read_text(encoding="utf-8").split("### Add an integrator")[1].split("\n## ")[0]
    found = re.search(r"^ *```python\n(.*?)^ *```$", section, re.DOTALL | re.MULTILINE)
    assert found
    return re.sub("^   ", "", found[1], flags=re.MULTILINE)


@pytest.fixture
def ros2() -> Iterator[dict[str, Any]]:
    """The guide's integrator, while a test lasts: what its module defines."""
    module: dict[str, Any] = {}
    exec(compile(example(), "ros2.py", "exec"), module)
    INTEGRATORS.add("ros2")
    yield module
    INTEGRATORS.remove("ros2")
    unregister("ros2")


def test_every_name_of_a_scene_has_an_integrator() -> None:
    assert {"auto", *FACTORIES} == set(INTEGRATORS)


def test_an_integrator_that_is_added_runs_a_scene(ros2: dict[str, Any]) -> None:
    def final(**numerics: object) -> Array:
        chosen = Numerics.model_validate({"points": 32, **numerics})
        run = simulate(shear_pair(1.5, numerics=chosen, horizon=3.0))
        assert run.failure is None
        return np.append(run.frames.tangent_angle[-1], run.frames.center[-1])

    reference = final(tolerance=1e-8)
    errors = [
        np.sqrt(np.mean((final(integrator="ros2", tolerance=tolerance) - reference) ** 2))
        for tolerance in (1e-3, 1e-4, 1e-5)
    ]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 1e-3


def test_the_method_of_the_guide_is_of_order_two_and_damps(ros2: dict[str, Any]) -> None:
    method = ros2["Ros2"]()
    coarse, fine = (oscillator_errors(method, count) for count in (32, 64))
    assert np.log2(np.array(coarse) / np.array(fine)) == pytest.approx(2, abs=0.2)
    assert amplification(method, 1e9) < 1e-6


def test_a_name_is_known_while_it_is_registered(ros2: dict[str, Any]) -> None:
    schema = TypeAdapter(Numerics).json_schema()["properties"]["integrator"]
    assert schema["enum"] == [*INTEGRATORS]
    assert "ros2" in schema["enum"]
    with pytest.raises(ValidationError, match=r"'imex-euler' or 'ros2'"):
        Numerics.model_validate({"integrator": "ros3"})


def test_a_name_is_registered_once() -> None:
    with pytest.raises(ValueError, match="an integrator 'bdf' is registered already"):
        register("bdf")(backward_differentiation)
    with pytest.raises(ValueError, match="the name 'bdf' is registered already"):
        INTEGRATORS.add("bdf")
