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


def test_a_damaged_cache_is_replaced(script: Path) -> None:
    """Both kinds of file: the index (nbi) and the machine code (nbc)."""
    assert run(script) == ("42 0", "")
    for suffix, damage in DAMAGES:
        (file,) = script.parent.rglob(f"*.{suffix}")
        damage(file)
        assert run(script) == ("42 0", ""), f"{suffix} {damage.__name__}"
    assert run(script) == ("42 1", "")


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
