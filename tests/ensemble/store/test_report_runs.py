"""Runs that were made for a report carry its name, and lists leave them out."""

from __future__ import annotations

import pytest

from ensemble.store import Store
from ensemble.store.filters import without_reports
from tests.ensemble.runs import shear_run, shear_scene


def test_lists_leave_the_runs_of_reports_out_unless_asked(tmp_path, ensemble):
    path = tmp_path / "store"
    with Store.open(path) as store:
        own = store.save(shear_run(shear_scene(rate=0.5)))
    with Store.open(path, report="paper") as store:
        made = store.save(shear_run(shear_scene(rate=0.75)))
        assert store.save(shear_run(shear_scene(rate=0.5))) == own
        assert [store.summary(key).report for key in (own, made)] == [None, "paper"]

    def listed(*options: str) -> set[str]:
        answer = ensemble("query", "runs", "--columns=key", f"--store={path}", *options)
        assert answer.returncode == 0, answer.stderr
        assert ("--reports lists them" in answer.stderr) == (not options)
        return set(answer.stdout.splitlines()[1:])

    assert listed() == {own}
    assert listed("--reports") == {own, made}
    assert listed("--where=report=paper") == {made}
    # They stay theirs when they are adopted from the disk, and in another store.
    (path / "catalog.sqlite").unlink()
    assert ensemble("check", "--repair", f"--store={path}").returncode == 0
    assert listed() == {own}


@pytest.mark.parametrize("asked", ["report=paper", " report != null", "report=null"])
def test_a_condition_on_the_report_is_taken_as_it_is(asked):
    assert without_reports(["outcome=bound", asked]) == ("outcome=bound", asked)
    assert without_reports(["outcome=bound", "reports=1"]) == ("outcome=bound", "reports=1", "report=null")
