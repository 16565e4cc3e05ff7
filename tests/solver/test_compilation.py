"""The cache of compiled functions: no damage to it, and no lack of it, stops or changes a computation."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = """
from solver.compilation import compiled

@compiled
def successor(x):
    return x + 1

print(successor(41), successor.stats.cache_hits.total())
"""

SLOW_SOURCE = f"""
import math
from solver.compilation import compiled

@compiled
def settled(x):
{"".join(f"    x = math.sqrt(x * x + {index}.0) + math.sin(x)" + chr(10) for index in range(600))}
    return x

@compiled
def twice(x):
    return 2.0 * settled(x)

twice(1.0)
print(twice.stats.cache_hits.total())
"""

# The velocity of one vesicle: of others by a sum over points, which is too long to be inlined unless it must
# be, and by a series.
SERIES_SOURCE = """
import hashlib, sys
import numpy as np
from solver.potentials import direct_sum, multipoles
from solver.potentials.vesicle_tree import NearVesicles

random = np.random.default_rng(1)
points, forces = random.standard_normal((2, 40, 64)), random.standard_normal((40, 2, 64))
centers, radii = np.zeros((2, 40)), np.full(40, 4.0)
series, velocity = random.standard_normal((1, 4, 33)), np.zeros((2, 1, 64))
near = NearVesicles(np.zeros(19, dtype=np.int64), np.arange(19))
if "directly" in sys.argv:
    direct_sum.velocity(points[:, 0].copy(), points[:, 1].copy(), forces[1])
multipoles.add_velocities(points, centers, radii, 0, series, np.array([12]), velocity)
direct_sum.add_near_velocities(points, forces, near, 0, velocity)
assert np.isfinite(velocity).all()
print(hashlib.sha256(velocity).hexdigest())
"""

FAILING_SOURCE = """
import subprocess, sys
from numba.core.errors import TypingError
from solver.compilation import compiled

@compiled
def successor(x):
    return x + 1

try:
    successor("a")
except TypingError:
    if __name__ != "other":
        other = "import runpy, sys; print(runpy.run_path(sys.argv[1], run_name='other')['successor'](41))"
        subprocess.run([sys.executable, "-c", other, __file__], check=True, timeout=60)
"""


def run(script: Path, prefix: str = "") -> tuple[str, str]:
    result = subprocess.run(
        [sys.executable, "-c", f"{prefix}\nimport runpy; runpy.run_path({str(script)!r})"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(script.parent)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.strip(), result.stderr.strip()


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "script.py"
    path.write_text(SOURCE)
    return path


def flip_a_byte(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)


def empty(path: Path) -> None:
    path.write_bytes(b"")


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


DAMAGES = [("nbi", empty), ("nbi", truncate), ("nbi", flip_a_byte), ("nbc", truncate), ("nbc", flip_a_byte)]


DAMAGING = """
from pathlib import Path
from runpy import run_path
from tests.solver.test_compilation import DAMAGES
script = Path({script!r})
run_path(script)
for suffix, damage in DAMAGES:
    (file,) = script.parent.rglob(f"*.{{suffix}}")
    damage(file)
    run_path(script)
run_path(script)
"""


def test_a_damaged_cache_is_replaced(tmp_path: Path, script: Path) -> None:
    """Both kinds of file: the index (nbi) and the machine code (nbc)."""
    damaging = tmp_path / "damaging"
    damaging.write_text(DAMAGING.format(script=str(script)))
    output, said = run(damaging)
    assert output.splitlines() == [*["42 0"] * (1 + len(DAMAGES)), "42 1"]
    assert said == ""


def test_a_full_disk_is_said_once(script: Path) -> None:
    """No file may grow, which is how the system answers a write beyond a quota."""
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))"
    output, said = run(script, full)
    assert output == "42 0"
    assert said.count("compiled functions are not kept") == 1
    assert len(said.splitlines()) == 1


def test_without_any_place_for_a_cache_a_function_is_compiled() -> None:
    """A function without a source file has no place; neither has one whose directories are read-only."""
    code = (
        "from solver.compilation import compiled\nscope = {}\n"
        "exec('def successor(x):\\n    return x + 1', scope)\nprint(compiled(scope['successor'])(41))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert result.stdout == "42\n"
    assert result.stderr.count("compiled functions are not kept") == 1


def test_what_is_compiled_is_announced_and_what_is_cached_is_not(script: Path) -> None:
    loud = "import logging; logging.basicConfig(format='%(message)s', level=logging.INFO)"
    _, said = run(script, loud)
    assert "compiling successor" in said.splitlines()
    _, said = run(script, loud)
    assert "compiling" not in said


def test_one_of_several_processes_compiles_and_the_others_load(tmp_path: Path) -> None:
    """The function takes some seconds to compile, so that all processes look for it before one has it."""
    script = tmp_path / "script.py"
    script.write_text(SLOW_SOURCE)
    command = [sys.executable, "-c", f"import runpy; runpy.run_path({str(script)!r})"]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(sys.path),
        "NUMBA_CACHE_DIR": str(tmp_path),
    }
    processes = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    hits = sorted(process.communicate()[0].strip() for process in processes)
    assert hits == ["0", "1", "1"]


ELSEWHERE = """
from solver.compilation import CompiledElsewhereError, without_waiting
try:
    with without_waiting():
        twice(1.0)
except CompiledElsewhereError as error:
    print("elsewhere", end=" ")
    assert error.wait()
"""


def test_a_process_may_do_something_else_while_another_one_compiles(tmp_path: Path) -> None:
    """Two at once, 5 s: one compiles, the other one is told so and loads when it has waited."""
    script = tmp_path / "script.py"
    script.write_text(SLOW_SOURCE.replace("twice(1.0)\n", ELSEWHERE + "twice(1.0)\n"))
    command = [sys.executable, "-c", f"import runpy; runpy.run_path({str(script)!r})"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(tmp_path)}
    processes = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    assert sorted(process.communicate()[0].strip() for process in processes) == ["0", "elsewhere 1"]


EDITING = """
import sys
from pathlib import Path
from runpy import run_path
directory = Path({directory!r})
sys.path.insert(0, str(directory))
sys.dont_write_bytecode = True  # or Python would take edits within a second for none
for text in {texts!r}:
    (directory / "definitions.py").write_text(text)
    for _ in range(2):
        sys.modules.pop("definitions", None)
        run_path(directory / "outer.py")
"""


def test_an_edit_of_what_a_function_calls_is_noticed(tmp_path: Path) -> None:
    """Numba itself looks at the file of the outermost function only."""
    definitions = (
        "from solver.compilation import compiled\n{constant}\n@compiled\ndef inner(x):\n    return {inner}\n"
    )
    (tmp_path / "outer.py").write_text(
        "from definitions import CONSTANT, inner\nfrom solver.compilation import compiled\n"
        "@compiled\ndef outer(x):\n    return CONSTANT * inner(x)\n"
        "print(outer(1.0), outer.stats.cache_hits.total())\n"
    )
    edits = [("CONSTANT = 1.0", "x"), ("CONSTANT = 1.0", "x + 1.0"), ("CONSTANT = 3.0", "x + 1.0")]
    texts = [definitions.format(constant=constant, inner=inner) for constant, inner in edits]
    (tmp_path / "editing").write_text(EDITING.format(directory=str(tmp_path), texts=texts))
    printed, _ = run(tmp_path / "editing")
    assert printed.splitlines() == ["1.0 0", "1.0 1", "2.0 0", "2.0 1", "6.0 0", "6.0 1"]


def test_bits_do_not_depend_on_what_was_compiled_or_loaded_before(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "NUMBA_CACHE_DIR": str(tmp_path)}
    digests = [
        subprocess.check_output([sys.executable, "-c", SERIES_SOURCE, *before], env=environment)
        for before in ([], [], ["directly"], ["directly"])
    ]
    assert len(set(digests)) == 1


def test_a_process_that_fails_to_compile_lets_the_others_try(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(FAILING_SOURCE)
    assert run(script) == ("42", "")
