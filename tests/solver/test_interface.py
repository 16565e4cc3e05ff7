"""What `import solver` offers, and what it costs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import solver
from solver.scene import Scene
from solver.simulation.simulate import simulate

ROOT = Path(__file__).resolve().parents[2]


def loaded_by(code: str) -> set[str]:
    """Names of the modules that are loaded once a piece of code has run in a process of its own."""
    command = [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=200)
    return set(done.stdout.split())


def test_every_public_name_is_there() -> None:
    for name in solver.__all__:
        assert getattr(solver, name) is not None
    assert solver.simulate is simulate
    assert solver.Scene is Scene
    assert set(solver.__all__) <= set(dir(solver))
    with pytest.raises(AttributeError, match="has no attribute 'Scenes'"):
        solver.Scenes  # type: ignore[attr-defined]  # noqa: B018


def test_a_scene_needs_neither_scipy_nor_compiled_kernels() -> None:
    heavy = {"numba", "scipy", "llvmlite"}
    scene = 'Scene(horizon=1.0, vesicles=[{}], flow={"kind": "trap", "rate": 0.1})'
    assert not heavy & loaded_by(f"from solver import Scene; {scene}.model_dump_json()")
    assert not heavy & loaded_by("from solver import Run, Outcome")


def test_a_name_loads_only_what_it_needs() -> None:
    assert "solver.scene" not in loaded_by("import solver")
    assert "numba" in loaded_by("from solver import simulate")


def test_the_example_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    assert len(example.splitlines()) <= 11
    exec(compile(example, "README.md", "exec"), {})
    outcome, period = capsys.readouterr().out.split()
    promised = re.search(r"# (\S+) (\S+)\n\Z", example)
    assert promised
    assert outcome == promised[1]
    assert f"{float(period):.2f}" == promised[2]
