"""The package's own names: imported on first use."""

from __future__ import annotations

import subprocess
import sys

import pytest

import ensemble
from ensemble.config.documents import load_scene, load_study
from ensemble.store.store import Store


@pytest.mark.parametrize(
    ("statement", "not_loaded"),
    [
        ("import ensemble", ["numpy", "pydantic", "sqlalchemy", "zarr", "matplotlib", "mpi4py", "typer"]),
        ("from ensemble import load_study", ["numba", "sqlalchemy", "zarr", "matplotlib", "mpi4py", "typer"]),
        ("from ensemble import Store", ["numba", "zarr", "h5py", "matplotlib", "mpi4py", "typer"]),
    ],
)
def test_a_name_loads_only_what_it_needs(statement: str, not_loaded: list[str]) -> None:
    code = f"{statement}; import sys; print(*(name for name in {not_loaded!r} if name in sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.split() == []


def test_the_names_are_what_they_say() -> None:
    assert (ensemble.Store, ensemble.load_scene, ensemble.load_study) == (Store, load_scene, load_study)
    assert set(ensemble.__all__) == {"Store", "load_scene", "load_study"}
    with pytest.raises(AttributeError, match="nothing"):
        _ = ensemble.nothing
