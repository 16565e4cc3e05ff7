"""Runs as groups of arrays on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ensemble.config.run_key import DISTRIBUTION
from ensemble.errors import OtherVersionError, StoreError
from ensemble.store.run_record import RunSummary, first_problem, rebuild
from ensemble.store.zarr_groups import StoredGroup
from solver.analysis.run import Run


class StoredArrays(StoredGroup):
    """The summary and the arrays of a run, of which only the rows that are asked for are read.

    Parameters
    ----------
    directory : Path
        Of the run.

    Attributes
    ----------
    summary : RunSummary

    Raises
    ------
    StoreError
        If there is no readable group, or its attributes are not those of a run.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(directory, "run")
        self.summary = _summary(self.name, self.attributes)

    @property
    def series(self) -> tuple[str, ...]:
        """The names of the recorded diagnostics."""
        return self.summary.series

    def run(self) -> Run:
        """Read the whole run; every number has the bits that were written.

        Returns
        -------
        Run

        Raises
        ------
        StoreError
            If an array is missing, incomplete or damaged.
        """
        return rebuild(self.summary, self.whole)


def _summary(name: str, attributes: dict[str, Any]) -> RunSummary:
    try:
        return RunSummary.model_validate(attributes)
    except ValidationError as error:
        written_by = attributes.get("versions")
        if isinstance(written_by, dict) and DISTRIBUTION in written_by:
            raise OtherVersionError(
                f"{name}: version {written_by[DISTRIBUTION]} wrote it and this version cannot "
                f"read it ({first_problem(error)})"
            ) from error
        raise StoreError(f"{name}: unreadable attributes ({first_problem(error)})") from error
