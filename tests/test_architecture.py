"""What may import what, and what the built wheel ships."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("solver", "ensemble", "api")
FORBIDDEN = {
    "solver": {
        "ensemble",
        "api",
        "mpi4py",
        "h5py",
        "zarr",
        "sqlalchemy",
        "matplotlib",
        "xarray",
        "typer",
        "rich",
        "fastapi",
    },
    "ensemble": {"api", "fastapi", "uvicorn"},
}
# The folders and modules of a package; none imports one that stands after it.
LEVELS = {
    "solver": (
        *("compilation", "model", "registry", "revision", "parallel"),
        *("flows", "pair_potentials", "scene"),
        *("membrane", "potentials", "forces", "motion", "integrators", "analysis", "simulation"),
    ),
}


def imports(source: str) -> Iterator[str]:
    """Names of all modules that a piece of source imports, wherever the statement stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module


def test_the_reader_of_imports_sees_every_form() -> None:
    source = (
        "import a.b, c\ndef f():\n    from d.e import g\n    import h as i\nif True:\n    from . import j\n"
    )
    assert set(imports(source)) == {"a.b", "c", "d.e", "h"}


@pytest.mark.parametrize("package", FORBIDDEN)
def test_dependencies_point_one_way(package: str) -> None:
    modules = sorted((ROOT / package).rglob("*.py"))
    assert modules
    offences = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules
        for name in imports(path.read_text(encoding="utf-8"))
        if name.split(".")[0] in FORBIDDEN[package]
    ]
    assert not offences


def parts(package: str, source: str) -> Iterator[str]:
    """Names of all folders or modules of a package that a piece of source imports something from."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module == package:
            yield from (name.name for name in node.names)
    for name in imports(source):
        top, *rest = name.split(".")
        if top == package and rest:
            yield rest[0]


def test_the_reader_of_parts_sees_every_form() -> None:
    source = "import a.b.c, b.d\nfrom a import e, f\nfrom a.g.h import i\nimport a\n"
    assert list(parts("a", source)) == ["e", "f", "b", "g"]


@pytest.mark.parametrize("package", LEVELS)
def test_no_folder_imports_a_later_one(package: str) -> None:
    level = {name: number for number, name in enumerate(LEVELS[package])}
    modules = [path for path in sorted((ROOT / package).rglob("*.py")) if path.parent.name != package]
    modules += [path for path in (ROOT / package).glob("*.py") if path.name != "__init__.py"]
    found = {path.relative_to(ROOT / package).parts[0].removesuffix(".py") for path in modules}
    assert found == level.keys() & found, "a folder without a level"
    offences = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules
        for name in parts(package, path.read_text(encoding="utf-8"))
        if level[name] > level[path.relative_to(ROOT / package).parts[0].removesuffix(".py")]
    ]
    assert not offences


@pytest.mark.parametrize(
    ("module", "unwanted"),
    [
        ("solver.scene", ["numba", "scipy", "mpi4py", "h5py", "zarr", "sqlalchemy", "matplotlib"]),
        ("solver.simulation.simulate", ["ensemble", "mpi4py", "h5py", "zarr", "sqlalchemy", "matplotlib"]),
    ],
)
def test_what_an_import_loads(module: str, unwanted: list[str]) -> None:
    code = f"import {module}, sys; print(*[name for name in {unwanted!r} if name in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True, timeout=120
    )
    assert loaded.stdout.split() == []


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Names of the files in a wheel built from a copy of the sources, so that no old build leaks into it."""
    directory = tmp_path_factory.mktemp("wheel")
    source = directory / "source"
    unwanted = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist")
    shutil.copytree(ROOT, source, ignore=unwanted)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    built = subprocess.run(
        [*command, "--wheel-dir", str(directory), str(source)], capture_output=True, text=True, timeout=240
    )
    assert built.returncode == 0, built.stderr
    (archive,) = directory.glob("*.whl")
    with zipfile.ZipFile(archive) as contents:
        return set(contents.namelist())


def test_the_wheel_ships_exactly_the_packages(wheel: set[str]) -> None:
    tops = {name.split("/")[0] for name in wheel}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)


def test_the_wheel_ships_every_module_and_preset(wheel: set[str]) -> None:
    data = ("py.typed", "presets/*.toml", "report/paper/*.toml", "migrations/*.mako", "static/**/*")
    sources = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for pattern in ("*.py", *data)
        for path in (ROOT / package).rglob(pattern)
        if path.is_file()
    }
    assert not sources - wheel
