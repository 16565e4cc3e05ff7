"""What one run of the work-precision report showed."""

from __future__ import annotations

from ensemble.report.report_model import Document


class Measurement(Document):
    """One run.  Errors are distances from the converged run's membranes; None if the run failed."""

    scene: str
    method: str
    points: int
    tolerance: float
    error_rms: float | None
    error_max: float | None
    wall_seconds: float
    evaluations: int
    steps: int
    failure: str | None
    run_key: str
