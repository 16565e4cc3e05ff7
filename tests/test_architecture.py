"""What may import what, and what the built wheel ships."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Mapping, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
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

# Folders and modules directly in each package, from the lowest.  Those of one line do not import each other.
ORDER = {
    "solver": """
        compilation dimensions memory model parallel registry revision roots
        flows pair_potentials protocols
        scene
        membrane
        potentials
        forces
        motion
        integrators steady_states
        analysis
        simulation
        __init__
        """,
    "ensemble": """
        disk errors timestamp
        config
        search
        figures store
        mpi
        display interrupts
        questions report
        cli
        __init__ __main__
        """,
    "api": """
        __init__ settings
        database http results
        auth jobs
        client routes worker
        app
        serve
        commands
        """,
}

# Levels of the solver's import graph at run time: a module is one above the highest that it imports when it
# is itself imported.  Imports for annotations and those within functions load nothing then.
MOST_LEVELS = 8


def imports(source: str) -> Iterator[str]:
    """Names of all modules that a piece of source imports, wherever the statement stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module


@cache
def modules(package: str) -> Mapping[str, Path]:
    """All modules of a package; the name of a folder is that of its ``__init__``."""
    paths = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return paths


def imported_modules(tree: ast.AST, known: Set[str], at_run_time: bool) -> set[str]:
    """Those of the known modules that a piece of source imports, everywhere or when it is itself imported."""
    found: set[str] = set()
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for name in node.names:
                within = f"{node.module}.{name.name}"
                found.add(within if within in known else node.module)
        elif not (at_run_time and is_left_out_at_run_time(node)):
            found |= imported_modules(node, known, at_run_time)
    return found & known


def is_left_out_at_run_time(node: ast.AST) -> bool:
    """Whether what a statement contains is not executed when its module is imported."""
    for_annotations = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    return for_annotations or isinstance(node, ast.FunctionDef)


@cache
def graph(package: str, at_run_time: bool = False) -> Mapping[str, Set[str]]:
    """The modules of a package that each of its modules imports."""
    known = modules(package)
    return {
        name: imported_modules(ast.parse(path.read_text(encoding="utf-8")), known.keys(), at_run_time)
        - {name}
        for name, path in known.items()
    }


def room(module: str) -> str:
    """The folder or module directly in its package in which a module lies."""
    return module.split(".")[1] if "." in module else "__init__"


def test_the_reader_of_imports_sees_every_form() -> None:
    source = (
        "import a.b, c\ndef f():\n    from d.e import g\n    import h as i\nif True:\n    from . import j\n"
    )
    assert set(imports(source)) == {"a.b", "c", "d.e", "h"}


def test_imports_at_run_time_are_those_that_load_a_module() -> None:
    source = (
        "from typing import TYPE_CHECKING\nimport p.a\nif TYPE_CHECKING:\n    from p.b import x\n"
        "def f():\n    from p import c\nif True:\n    from p import d, e\nclass C:\n    import p.f\n"
    )
    known = {"p", *(f"p.{letter}" for letter in "abcdfg")}
    assert imported_modules(ast.parse(source), known, True) == {"p", "p.a", "p.d", "p.f"}
    assert imported_modules(ast.parse(source), known, False) == {"p", *(f"p.{letter}" for letter in "abcdf")}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_imports_a_higher_one(package: str) -> None:
    """Nor another one of its own line; imports for annotations and within functions count."""
    order = {name: line for line, names in enumerate(ORDER[package].split("\n")) for name in names.split()}
    assert order.keys() == {room(name) for name in modules(package)}
    offences = [
        f"{name} imports {other}"
        for name, others in graph(package).items()
        for other in sorted(others)
        if room(other) != room(name) and order[room(other)] >= order[room(name)]
    ]
    assert not offences


@pytest.mark.parametrize("package", PACKAGES)
def test_no_modules_import_each_other_in_a_circle(package: str) -> None:
    try:
        TopologicalSorter(graph(package)).prepare()
    except CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))


def test_the_solver_has_few_levels_of_imports() -> None:
    imported, level = graph("solver", at_run_time=True), dict[str, int]()
    for module in TopologicalSorter(imported).static_order():
        level[module] = 1 + max((level[other] for other in imported[module]), default=0)
    chain = [max(level, key=level.__getitem__)]
    while imported[chain[-1]]:
        chain.append(max(imported[chain[-1]], key=level.__getitem__))
    assert len(chain) == max(level.values()) <= MOST_LEVELS, " imports ".join(chain)


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


@pytest.mark.parametrize(
    ("module", "unwanted"),
    [
        ("solver.scene", ["numba", "scipy", "mpi4py", "h5py", "zarr", "sqlalchemy", "matplotlib"]),
        ("solver.simulation.simulate", ["ensemble", "mpi4py", "h5py", "zarr", "sqlalchemy", "matplotlib"]),
        (
            "solver.simulation.simulate",
            ["scipy.interpolate", "scipy.optimize", "scipy.sparse", "scipy.spatial"],
        ),
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
