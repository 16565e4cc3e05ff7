"""Progress as a program reads it: lines of JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from rich.console import Console


class ProgressLine(BaseModel):
    """How far a job or a simulation has come, in one line of JSON.

    Attributes
    ----------
    fraction : float
        From 0 to 1.
    message : str
        The same for people.
    reached : float
        The work behind it, to compare attempts with each other: the number of runs that are kept, or the
        percentage of the only run.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    fraction: float = Field(ge=0, le=1)
    message: str
    reached: float = Field(ge=0)

    def print_on(self, console: Console) -> None:
        """Print the line.

        Parameters
        ----------
        console : Console
            Where it is printed.
        """
        console.print(self.model_dump_json(), soft_wrap=True, highlight=False, markup=False)
