"""The log of a job: what its processes write to standard error, and what became of its attempts."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

TAIL_BYTES = 4096
LAST_LINES = 5


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
        said = [line.strip() for line in lines if line.strip() and not _is_progress(line)]
        return " | ".join(said[-LAST_LINES:])


def _is_progress(line: str) -> bool:
    return line[:4].strip().removesuffix("%").isdigit() and line[3:6] == "%  "
