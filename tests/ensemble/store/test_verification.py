"""A check may be shared by processes and interrupted; it names the same problems."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from ensemble.store import Store, verification
from tests.ensemble.group_files import unpacked
from tests.ensemble.runs import shear_run, shear_scene

RUNS = 7


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """A store of seven runs, of which the third and the sixth are damaged."""
    with Store.open(tmp_path / "store") as opened:
        keys = [
            opened.save(shear_run(shear_scene(rate=1 + number / 8), seed=number)) for number in range(RUNS)
        ]
        for key in (keys[2], keys[5]):
            with unpacked(opened.path / "runs" / key) as files:
                (files / "gap" / "c" / "0").unlink()
        yield opened


def entries(store: Store) -> set[str]:
    return {entry.name for entry in store.path.iterdir()}


def test_several_processes_find_the_same(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processes begin, which takes 4 s of processor time."""
    alone = store.check()
    assert len(alone) == 2
    monkeypatch.setattr(verification, "ALONE", 1)
    monkeypatch.setattr(verification, "AT_ONCE", 2)
    seen = []
    before = entries(store)
    assert store.check(lambda *progress: seen.append(progress), processes=2) == alone
    assert seen == [(number, RUNS) for number in range(1, RUNS + 1)]
    assert entries(store) == before


def interrupted(store: Store, after: int) -> None:
    def interrupt(verified: int, _: int) -> None:
        if verified == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.check(interrupt)


def test_an_interrupted_check_goes_on_and_forgets_no_problem(store: Store) -> None:
    problems, before = store.check(), entries(store)
    interrupted(store, after=4)
    seen = []
    interrupted(store, after=5)
    assert store.check(lambda *progress: seen.append(progress)) == problems
    # Four were whole: the first, the second and the fourth, and then the fifth.
    assert [verified for verified, _ in seen] == [5, 6, 7]
    assert entries(store) == before
    assert store.check(lambda *progress: seen.append(progress)) == problems
    assert len(seen) == 3 + RUNS


def test_notes_of_another_day_are_not_trusted(store: Store) -> None:
    interrupted(store, after=4)
    notes = store.path / verification.NOTES
    _, *keys = notes.read_text().splitlines()
    notes.write_text("\n".join(["2026-01-01T00:00:00+00:00", *keys]))
    seen = []
    store.check(lambda *progress: seen.append(progress))
    assert len(seen) == RUNS


@pytest.mark.parametrize("content", ["", "no time\n", "2026-01-01\n", "\0"])
def test_notes_that_are_torn_are_not_trusted(store: Store, content: str) -> None:
    (store.path / verification.NOTES).write_text(content)
    seen = []
    store.check(lambda *progress: seen.append(progress))
    assert len(seen) == RUNS
