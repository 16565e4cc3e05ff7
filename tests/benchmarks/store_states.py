"""Tries every command on stores in unusual states, and prints as a table what each did.

    python -m tests.benchmarks.store_states DIRECTORY

Each command gets a fresh copy.  Needs root, to mount small and read-only disks and to become other users.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx2

from ensemble.store import Store
from tests.conftest import ENSEMBLE
from tests.ensemble.runs import shear_run, shear_scene
from tests.full_disks import filled, small_disk

QUICK = ("--set=horizon=1", "--set=numerics.points=32", "--set=numerics.tolerance=1e-3")
STUDY = ("--set=sweep.values=[0.5]", "--set=scene.numerics.points=32", "--set=scene.numerics.tolerance=1e-3")
GROUP, OTHER_USER = 12345, 12346
SECONDS_TO_SERVE = 120
COMMANDS = ("run", "bisect", "query", "show", "check", "check --repair", "export", "merge", "serve")

# A file system that does not flush directories cannot be mounted here; this is the answer that one gives.
WITHOUT_DIRECTORY_FLUSH = """
import errno, os, stat
flush = os.fsync
def fsync(descriptor):
    if stat.S_ISDIR(os.fstat(descriptor).st_mode):
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    flush(descriptor)
os.fsync = fsync
from ensemble.__main__ import main
main()
"""


@dataclass
class State:
    """A store, and how commands are started on it."""

    path: Path
    python: tuple[str, ...] = ENSEMBLE
    options: dict[str, Any] = field(default_factory=dict)


Make = Callable[[Path, Path], AbstractContextManager[State]]


def numbered(number: int) -> Any:
    """A run made up, which no command makes."""
    return shear_run(shear_scene(rate=2 + number / 128), seed=number)


@contextmanager
def merged(base: Path, place: Path) -> Iterator[State]:
    """Runs of another store were copied in."""
    other = place / "other"
    with Store.open(other) as store:
        store.save(numbered(1))
    subprocess.run(["cp", "-rn", f"{other}/.", str(shutil.copytree(base, place / "store"))], check=False)
    yield State(place / "store")


@contextmanager
def old_catalog(base: Path, place: Path) -> Iterator[State]:
    """A catalog from before the last run was put back."""
    path = shutil.copytree(base, place / "store")
    with Store.open(path) as store:
        store.save(numbered(1))
    shutil.copy(base / "catalog.sqlite", path / "catalog.sqlite")
    yield State(path)


@contextmanager
def lost_log(base: Path, place: Path) -> Iterator[State]:
    """The write-ahead log of a catalog, as earlier versions kept one, was not copied with it."""
    path = shutil.copytree(base, place / "live")
    with Store.open(path) as store:
        store.save(numbered(1))
        (row,) = store.runs_page(limit=1)
    shutil.copy(base / "catalog.sqlite", path / "catalog.sqlite")
    connection = sqlite3.connect(path / "catalog.sqlite")
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    connection.execute("INSERT INTO runs VALUES (?, '2026-01-01', ?)", row)
    connection.commit()
    copy = shutil.copytree(path, place / "store")
    connection.close()
    for suffix in ("-wal", "-shm"):
        (copy / f"catalog.sqlite{suffix}").unlink()
    yield State(copy)


@contextmanager
def read_only(base: Path, place: Path) -> Iterator[State]:
    """Mounted read-only."""
    path = shutil.copytree(base, place / "store")
    subprocess.run(["mount", "--bind", path, path], check=True)
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", path], check=True)
        yield State(path)
    finally:
        subprocess.run(["umount", "--lazy", path], check=True)


@contextmanager
def shared(base: Path, place: Path) -> Iterator[State]:
    """Made by one user of a group, used by another one, with umask 002 and the directory's group set."""
    path = shutil.copytree(base, place / "store")
    for parent, names, files in os.walk(path):
        for name in [".", *names, *files]:
            entry = Path(parent, name)
            os.chown(entry, 0, GROUP)
            entry.chmod(0o2775 if entry.is_dir() else 0o664)
    place.chmod(0o777)
    # The interpreter may be where only root looks: this user reads everything and writes only what is shared.
    become = f"--reuid={OTHER_USER} --regid={GROUP} --clear-groups"
    reading = "--inh-caps=+dac_read_search --ambient-caps=+dac_read_search"
    python = ("setpriv", *become.split(), *reading.split(), *ENSEMBLE)
    yield State(path, python, {"umask": 0o002, "env": os.environ | {"HOME": str(place)}})


@contextmanager
def without_directory_flush(base: Path, place: Path) -> Iterator[State]:
    """On a file system that refuses to flush directories."""
    yield State(shutil.copytree(base, place / "store"), (sys.executable, "-c", WITHOUT_DIRECTORY_FLUSH))


@contextmanager
def full(base: Path, place: Path) -> Iterator[State]:
    """On a full disk."""
    with small_disk(place / "disk", "size=12m") as disk, ExitStack() as stack:
        path = shutil.copytree(base, disk / "store")
        stack.enter_context(filled(disk))
        yield State(path)


STATES: tuple[Make, ...] = (merged, old_catalog, lost_log, read_only, shared, without_directory_flush, full)


def arguments(command: str, base: Path, state: State, key: str) -> list[str]:
    """What a command is given, beyond the store."""
    place = state.path.parent
    return {
        "run": ["run", "vesicle-shear", *QUICK],
        "bisect": ["bisect", *STUDY, "--tolerance=0.2"],
        "query": ["query", "runs"],
        "show": ["show", key],
        "check": ["check"],
        "check --repair": ["check", "--repair"],
        "export": ["export", key, str(place / "run.h5")],
        "merge": ["merge", str(base), f"--into={state.path}"],
        "serve": ["serve", "--port=0"],
    }[command]


def tried(command: str, base: Path, state: State, key: str) -> str:
    """Carry out a command and say what it did."""
    line = [*state.python, *arguments(command, base, state, key)]
    if command != "merge":
        line.append(f"--store={state.path}")
    if command == "serve":
        return served(line, state)
    result = subprocess.run(line, capture_output=True, text=True, check=False, timeout=600, **state.options)
    if "Traceback" in result.stderr:
        return f"{result.returncode} TRACEBACK"
    lines = [each for each in result.stderr.splitlines() if "ensemble:" in each or "store:" in each]
    said = "; ".join(lines) or (result.stdout.strip().splitlines() or [""])[-1]
    if command == "query" and result.returncode == 0:
        said = f"{len(result.stdout.splitlines()) - 1} runs"
    if command == "show" and result.returncode == 0:
        said = ""
    return shortened(f"{result.returncode} {said}", state)


def served(line: list[str], state: State) -> str:
    """Start the service, ask it, and stop it."""
    log = state.path.parent.parent / f"{state.path.parent.name}.log"
    with log.open("w") as output:
        process = subprocess.Popen(line, stdout=output, stderr=output, **state.options)
        deadline = time.monotonic() + SECONDS_TO_SERVE
        while process.poll() is None and time.monotonic() < deadline:
            found = re.search(r"running on (http://[\d.]+:\d+)", log.read_text())
            if found:
                ready = httpx2.get(f"{found[1]}/readyz", timeout=60).status_code
                runs = len(httpx2.get(f"{found[1]}/runs", timeout=60).json()["items"])
                process.send_signal(signal.SIGTERM)
                process.wait()
                return f"{runs} runs, readyz {ready}"
            time.sleep(0.1)
        process.kill()
        status = process.wait()
    said = log.read_text()
    return "TRACEBACK" if "Traceback" in said else shortened(f"{status} {said.splitlines()[-1]}", state)


def shortened(said: str, state: State) -> str:
    """Leave out where the store is, and digits of keys."""
    said = said.replace(str(state.path), "S").replace(str(state.path.parent), ".")
    return re.sub(r"\b([0-9a-f]{4})[0-9a-f]{28}\b", r"\1…", said).replace("ensemble: ", "").replace("|", "/")


def main() -> None:
    """Try all and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    directory: Path = parser.parse_args().directory
    directory.mkdir(parents=True)
    directory.chmod(0o755)
    base = directory / "base"
    command = [*ENSEMBLE, "bisect", *STUDY, "--tolerance=0.2", f"--store={base}"]
    subprocess.run(command, check=True, capture_output=True)
    with Store.open(base) as store:
        key = store.save(numbered(0))
    print(f"| | {' | '.join(f'`{command}`' for command in COMMANDS)} |\n|---|{'---|' * len(COMMANDS)}")
    for make in STATES:
        cells = []
        for number, command in enumerate(COMMANDS):
            place = directory / f"{make.__name__}-{number}"
            place.mkdir()
            with make(base, place) as state:
                cells.append(tried(command, base, state, key))
        print(f"| {make.__name__.replace('_', ' ')} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
