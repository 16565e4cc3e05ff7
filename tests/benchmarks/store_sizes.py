"""What a store costs that holds many runs: seconds and memory of what users do, and inodes.

    nice python -m tests.benchmarks.store_sizes DIRECTORY 1000 10000 100000

The runs are made up.  Their files are copies of one run's, with attributes of their own, and they are
committed a thousand at a time.  Each measurement is a process of its own; the time that it needs to begin is
part of what commands take and of nothing else.  A store of the same size that is in the directory is used.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import uuid4
from zipfile import ZipFile, ZipInfo

from sqlalchemy import insert

from ensemble.config.documents import load_study
from ensemble.config.run_key import run_key
from ensemble.search.study_planner import StudyPlanner
from ensemble.store import Staged, Store
from ensemble.store.catalog_tables import RunRow
from ensemble.store.listing import Listing, ParameterRange
from ensemble.store.sql_database import Place, engine
from ensemble.store.zarr_groups import ARCHIVE
from ensemble.timestamp import now, timestamp_text
from solver.scene import Scene
from tests.conftest import ENSEMBLE
from tests.ensemble.runs import shear_run, shear_scene

RATES = 64
GRID = load_study("critical-hamaker").search.grid
CHECKED_FOR = 60.0  # seconds, after which what is left of a check is estimated
SAVED = 30
AT_ONCE = 1000


def scene(number: int) -> Scene:
    """A scene that no other number has; one in eight has a rate of the default study."""
    hamaker = GRID.value(-100 + number // RATES % 200)
    area = 0.9 - 0.01 * (number // (RATES * 200))
    return shear_scene(rate=0.03125 * (1 + number % RATES), hamaker=hamaker, reduced_area=area)


class Copies:
    """Stages runs by copying the files of one."""

    def __init__(self, store: Store) -> None:
        self._store = store
        run = shear_run()
        staged = store.stage(run)
        self._summary = staged.summary
        self._directory = staged.directory.parent
        with ZipFile(staged.directory / ARCHIVE) as archive:
            self._members = {name: archive.read(name) for name in archive.namelist()}
        shutil.rmtree(staged.directory)

    def stage(self, made: Scene) -> Staged:
        """Write a run that is not committed."""
        changes = {"scene": made, "key": run_key(made), "created": now(), "gap": random.uniform(0.2, 1.2)}
        summary = self._summary.model_copy(update=changes)
        directory = self._directory / uuid4().hex
        directory.mkdir()
        root = json.loads(self._members["zarr.json"]) | {"attributes": summary.document()}
        with ZipFile(directory / ARCHIVE, "w") as archive:
            for name, content in (self._members | {"zarr.json": json.dumps(root).encode()}).items():
                archive.writestr(ZipInfo(name), content)
        return Staged(directory, summary)


def fill(path: Path, size: int) -> None:
    """Bring a store to a size."""
    with Store.open(path) as store:
        copies, there = Copies(store), store.count_runs()
        for begin in range(there, size, AT_ONCE):
            commit_all(
                store, [copies.stage(scene(number)) for number in range(begin, min(begin + AT_ONCE, size))]
            )
            print(f"{begin} runs", file=sys.stderr, flush=True)


def commit_all(store: Store, staged: list[Staged]) -> None:
    """Commit runs with one transaction, where the store makes one for each."""
    for each in staged:
        each.directory.rename(store.path / "runs" / each.key)
    rows = [
        {
            "key": each.key,
            "created": timestamp_text(each.summary.created),
            "document": each.summary.document(),
        }
        for each in staged
    ]
    with engine(Place.of(store.path).url, journal="delete").begin() as connection:
        connection.execute(insert(RunRow), rows)


def open_to_write(path: Path) -> None:
    """Open the store as a study does."""
    Store.open(path).close()


def first_task(path: Path) -> None:
    """Open the store and plan the default study as far as its first task."""
    with Store.open(path) as store:
        study = load_study("critical-hamaker")
        made = store.parameters_within(
            ParameterRange("flow.rate", min(study.sweep[0].values), max(study.sweep[0].values)),
            ParameterRange("adhesion.hamaker", *study.search.limits),
        )
        planner = StudyPlanner(study, store.answer, (((at,), value) for at, value in made))
        assert planner.next_task() is not None


def commit(path: Path) -> float:
    """Return how long the commit of a run takes whose files are written: the dispatcher's part."""
    with Store.open(path) as store:
        copies = Copies(store)
        staged = [copies.stage(shear_scene(rate=3 + number / 128)) for number in range(SAVED)]
        begin = time.perf_counter()
        keys = [store.commit(each) for each in staged]
        return _each(begin, store, keys)


def save(path: Path) -> float:
    """Return how long it takes to write a run, flush it to disk and commit it."""
    with Store.open(path) as store:
        runs = [shear_run(shear_scene(rate=3 + number / 128)) for number in range(SAVED)]
        begin = time.perf_counter()
        keys = [store.save(run) for run in runs]
        return _each(begin, store, keys)


def _each(begin: float, store: Store, keys: list[str]) -> float:
    """Return the time for each run, and take them out again."""
    seconds = (time.perf_counter() - begin) / len(keys)
    for key in keys:
        shutil.rmtree(store.set_aside(key))
    return seconds


def page(path: Path) -> float:
    """Return how long the service takes to answer with a page of runs, after the first one."""
    from tests.api.servers import client_of

    with client_of(path) as client:
        last = client.get("/runs").json()["items"][-1]["key"]
        begin = time.perf_counter()
        assert client.get("/runs", params={"after": last}).status_code == 200
        return time.perf_counter() - begin


def rare(path: Path) -> None:
    """List the ten runs with the smallest gap of a rate."""
    with Store.existing(path) as store:
        assert list(store.run_records(Listing(("flow.rate=0.5",), "gap", 10)))


class TimeOverError(Exception):
    """The time is over."""


def check(path: Path) -> str:
    """Verify all, or as much as there is time for; return for how long, or an estimate."""
    begin = time.perf_counter()
    done = 0, 1

    def on_progress(verified: int, total: int) -> None:
        nonlocal done
        done = verified, total
        if time.perf_counter() - begin > CHECKED_FOR:
            raise TimeOverError

    with Store.open(path) as store:
        try:
            assert store.check(on_progress, len(os.sched_getaffinity(0))) == []
        except TimeOverError:
            (path / "unfinished-check").unlink()
            verified, total = done
            return f"about {CHECKED_FOR * total / verified:.0f} (estimated from {verified})"
    return f"{time.perf_counter() - begin:.1f}"


MEASURED: dict[str, Callable[[Path], Any]] = {
    "open": open_to_write,
    "first task": first_task,
    "smallest ten": rare,
    "commit": commit,
    "save": save,
    "page": page,
    "check": check,
}


def measure(name: str, path: Path) -> None:
    """Print what one measurement came to."""
    begin = time.perf_counter()
    result = MEASURED[name](path)
    seconds = time.perf_counter() - begin if result is None else result
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    text = seconds if isinstance(seconds, str) else f"{seconds:.3f}"
    print(f"{text} s, {memory:.0f} MB")


def command(*arguments: str) -> str:
    """Return how long a command takes and how much memory it needs."""
    begin = time.perf_counter()
    subprocess.run([*ENSEMBLE, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return f"{time.perf_counter() - begin:.2f} s, {memory:.0f} MB"


def inodes(path: Path) -> int:
    """Count the files and directories of the runs."""
    return sum(1 + len(list(directory.iterdir())) for directory in (path / "runs").iterdir())


def main() -> None:
    """Fill and measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("sizes", type=int, nargs="*")
    parser.add_argument("--measure", choices=MEASURED, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.measure, arguments.directory)
        return
    for size in arguments.sizes:
        path = arguments.directory / f"store-{size}"
        path.parent.mkdir(exist_ok=True)
        fill(path, size)
        print(f"{size} runs: {inodes(path)} inodes", flush=True)
        place = f"--store={path}"
        # Before the others: the memory of children is that of the largest so far.
        print(f"  query runs: {command('query', 'runs', place)}", flush=True)
        print(f"  query runs --limit 0: {command('query', 'runs', '--limit=0', place)}", flush=True)
        for name in MEASURED:
            child = [sys.executable, "-m", __spec__.name, str(path), "--measure", name]
            print(
                f"  {name}: {subprocess.run(child, check=True, stdout=-1, text=True).stdout.strip()}",
                flush=True,
            )


if __name__ == "__main__":
    main()
