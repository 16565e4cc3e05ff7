"""What each test costs in processor time, which depends less than the clock on what else the machine does."""

from __future__ import annotations

import resource
from collections import Counter
from collections.abc import Generator

import pytest

SHOWN = 10
_of_others = [0.0]  # seconds


def add(seconds: float) -> None:
    """Count what a process cost that is no child of this one."""
    _of_others[0] += seconds


def spent() -> float:
    """Return the processor time of this process, of children that have ended and of others, in seconds."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages) + _of_others[0]


class ProcessorTimes:
    """Measures every test with the fixtures made and removed for it; prints the slowest.

    As many as ``--durations`` says, all for 0.
    """

    def __init__(self, shown: int | None) -> None:
        self.shown = SHOWN if shown is None else shown
        self.totals: Counter[str] = Counter()
        self.last = 0.0

    def pytest_runtest_logstart(self) -> None:
        """Leave out what happened between tests."""
        self.last = spent()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Note in the report of a phase what it took; workers send it to the process that prints."""
        report = yield
        now = spent()
        report.processor_time, self.last = now - self.last, now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up a test's phases."""
        self.totals[report.nodeid] += getattr(report, "processor_time", 0.0)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the slowest tests."""
        terminalreporter.section(f"slowest by processor time, of {self.totals.total():.0f} s in all")
        for name, seconds in self.totals.most_common(self.shown or None):
            terminalreporter.write_line(f"{seconds:7.2f} s  {name}")
