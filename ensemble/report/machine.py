"""On what a report was made."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path

from ensemble.report.report_model import Document
from ensemble.store.run_record import RESULT_PACKAGES


class Machine(Document):
    """The computer and the versions behind a report's numbers."""

    processor: str
    system: str
    versions: dict[str, str]

    @classmethod
    def here(cls) -> Machine:
        """Describe this computer."""
        versions = {package: version(package) for package in RESULT_PACKAGES}
        return cls(
            processor=_processor(),
            system=f"{platform.system()} {platform.machine()}",
            versions=versions | {"python": platform.python_version()},
        )

    def sentence(self) -> str:
        """Say it in one line."""
        packages = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        return f"{self.processor}, {self.system}; {packages}"


def _processor() -> str:
    """Model of the processor; Linux tells it only in a file."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
