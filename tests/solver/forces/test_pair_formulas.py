"""Formulas in compiled loops: cached on disk for all processes, and compiled anew once they are edited."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import typeof

from solver.forces.pair_formulas import PairFormula, derivatives
from solver.pair_potentials import PowerLaw

PROCESS = """
import numpy as np
from potential import formula
from solver.forces.pair_formulas import PairFormula
from solver.forces.pair_sums import pair_energy

points, weights = np.zeros((2, 1)), np.ones(1)
energy = pair_energy(PairFormula(formula, {truncated}), {parameters}, points, points + 0.5, weights)
print(energy, pair_energy.stats.cache_hits.total())
"""

FORMULA = "def formula(square, parameters):\n    return {factor} * square, {factor}, 0.0\n"


def energy_and_hits(directory: Path, factor: float, truncated: bool = False) -> tuple[float, int]:
    """What a process of its own computes with a formula, and how many compiled loops it found on disk."""
    (directory / "potential.py").write_text(FORMULA.format(factor=factor))
    parameters = "(0.1, 5.0, (1.0,))" if truncated else "(1.0,)"
    result = subprocess.run(
        [sys.executable, "-c", PROCESS.format(truncated=truncated, parameters=parameters)],
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join([str(directory), *sys.path]),
            "PYTHONDONTWRITEBYTECODE": "1",
            "NUMBA_CACHE_DIR": str(directory),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    energy, hits = result.stdout.split()
    return float(energy), int(hits)


def test_loops_are_cached_for_all_processes_until_the_formula_is_edited(tmp_path: Path) -> None:
    assert energy_and_hits(tmp_path, 2.0) == (pytest.approx(1.0), 0)
    assert energy_and_hits(tmp_path, 2.0) == (pytest.approx(1.0), 1)
    assert energy_and_hits(tmp_path, 6.0) == (pytest.approx(3.0), 0)
    assert energy_and_hits(tmp_path, 2.0) == (pytest.approx(1.0), 1)
    truncated, hits = energy_and_hits(tmp_path, 2.0, truncated=True)
    assert 0 < truncated < 1
    assert hits == 0


def test_a_constant_of_the_module_belongs_to_the_formula() -> None:
    def type_of(constant: float, factor: float) -> str:
        scope: dict[str, Any] = {"__name__": "edited"}
        source = f"CONSTANT = {constant}\ndef formula(square, parameters):\n"
        exec(source + f"    return {factor} * CONSTANT * square, 0.0, 0.0\n", scope)
        return str(typeof(PairFormula(scope["formula"], truncated=False)))

    assert len({type_of(constant, factor) for constant in (1.0, 2.0) for factor in (3.0, 4.0)}) == 4
    assert type_of(1.0, 3.0) == type_of(1.0, 3.0)


def test_outside_of_compiled_loops_a_potential_is_evaluated() -> None:
    potential = PowerLaw(hamaker=1.0, distance=0.4)
    formula = PairFormula(potential.formula, truncated=False)
    with pytest.raises(NotImplementedError, match=r"PairPotential\.evaluate"):
        derivatives(formula, 1.0, potential.parameters)
