"""What all reports share: the base of their data, and the description of the computer that made them."""

from __future__ import annotations

import platform
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from ensemble.store.versions import result_versions


class ReportModel(BaseModel):
    """Base of everything in a report: immutable, and strictly valid JSON, so without NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Machine(ReportModel):
    """The computer and the versions behind the numbers of a report.

    Attributes
    ----------
    processor : str
        Model of the processor.
    system : str
        Operating system and architecture.
    versions : dict of str to str
        Version of each package that numbers depend on, and of Python.
    """

    processor: str
    system: str
    versions: dict[str, str]

    @classmethod
    def here(cls) -> Machine:
        """Describe this computer."""
        return cls(
            processor=_processor(),
            system=f"{platform.system()} {platform.machine()}",
            versions=result_versions(),
        )

    def sentence(self) -> str:
        """Return the description as one line of text."""
        packages = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        return f"{self.processor}, {self.system}; {packages}"


def _processor() -> str:
    """Return the model of the processor, which Linux only tells in a file."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
