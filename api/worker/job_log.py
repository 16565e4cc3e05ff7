"""The log of a job: what its processes write to standard error, and what became of its attempts."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

from ensemble.display.progress_line import ProgressLine

TAIL_BYTES = 4096
LAST_LINES = 5
_PROGRESS = re.compile(r"[ \d]{2}\d%  ")  # what `JobLog.add_progress` begins a line with


class JobLog:
    """A file that lines are appended to, as far as the disk takes them: a job does not end for its log.

    Parameters
    ----------
    path : Path
        It may not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def add(self, line: str) -> None:
        """Append a line.

        Parameters
        ----------
        line : str
        """
        with suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write(line if line.endswith("\n") else f"{line}\n")

    def add_progress(self, progress: ProgressLine) -> None:
        """Append a line about progress, which `end` leaves out.

        Parameters
        ----------
        progress : ProgressLine
        """
        self.add(f"{progress.fraction:4.0%}  {progress.message}")

    def end(self) -> str:
        """Return the last lines that say something, without those about progress.

        Returns
        -------
        str
            One line.
        """
        try:
            with self._path.open("rb") as file:
                file.seek(max(self._path.stat().st_size - TAIL_BYTES, 0))
                lines = file.read().decode(errors="replace").splitlines()
        except OSError:
            return "there is no log"
        said = [line.strip() for line in lines if line.strip() and not _PROGRESS.match(line)]
        return " | ".join(said[-LAST_LINES:])
