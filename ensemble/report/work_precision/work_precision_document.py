"""The work-precision report as data."""

from __future__ import annotations

from ensemble.report.report_model import Machine, ReportModel


class ConvergedRun(ReportModel):
    """The run of a scene from which errors are measured.

    Attributes
    ----------
    scene : str
        Name of the scene.
    points : int
        Points on each vesicle.
    tolerance : float
        Tolerance of the time steps.
    uncertainty : float
        Largest distance of the membranes of a slightly coarser run from those of this one.
    wall_seconds : float
        Time that the simulation took.
    run_key : str
        Key of the run.
    """

    scene: str
    points: int
    tolerance: float
    uncertainty: float
    wall_seconds: float
    run_key: str


class Measurement(ReportModel):
    """Error and cost of one run.

    Attributes
    ----------
    scene, method : str
        Names of the scene and of the integrator.
    points : int
        Points on each vesicle.
    tolerance : float
        Tolerance of the time steps.
    error_rms, error_max : float or None
        Distance of the final membranes from those of the converged run, over all points; None if the run
        failed.
    error_reported : float or None
        That of positions which the run itself reports (`error.global`); None if it reports none.
    wall_seconds : float
        Time that the simulation took.
    evaluations, steps : int
        Evaluations of the right-hand side and accepted time steps.
    failure : str or None
        Why the run failed.
    run_key : str
        Key of the run.
    """

    scene: str
    method: str
    points: int
    tolerance: float
    error_rms: float | None
    error_max: float | None
    error_reported: float | None
    wall_seconds: float
    evaluations: int
    steps: int
    failure: str | None
    run_key: str


class ObservedOrder(ReportModel):
    """Observed order of convergence: error ∝ evaluations^(−order).

    Attributes
    ----------
    scene, method : str
        Names of the scene and of the integrator.
    points : int
        Points on each vesicle.
    order : float or None
        By least squares; None with fewer than two measurements.
    fitted : int
        Number of measurements in the fit.
    """

    scene: str
    method: str
    points: int
    order: float | None
    fitted: int


class LeastTime(ReportModel):
    """Least time to reach an error, at whatever tolerance and number of points.

    Attributes
    ----------
    scene : str
        Name of the scene.
    error : float
        The error that is reached.
    fastest : str or None
        The fastest method; None if no method reaches the error.
    fastest_seconds : float or None
        Its time.
    default : str
        The method that such a scene has by default.
    default_seconds : float or None
        Its time; None if it never reaches the error.
    slowdown : float or None
        Time of the default method over that of the fastest one.
    speedup : float or None
        Time of spectral deferred correction of order 2 over that of the default method.
    """

    scene: str
    error: float
    fastest: str | None
    fastest_seconds: float | None
    default: str
    default_seconds: float | None
    slowdown: float | None
    speedup: float | None


class DoubletAnswer(ReportModel):
    """Period and intrinsic viscosity of the doublet in shear from one run, with their relative errors.

    Attributes
    ----------
    method : str
        Name of the integrator.
    points : int
        Points on each vesicle.
    tolerance : float
        Tolerance of the time steps.
    period, viscosity : float or None
        None if the run failed.
    period_error, viscosity_error : float or None
        Relative difference from the converged run.
    period_reported, viscosity_reported : float or None
        The same as the run itself reports it.
    wall_seconds : float
        Time that the simulation took.
    evaluations : int
        Evaluations of the right-hand side.
    failure : str or None
        Why the run failed.
    run_key : str
        Key of the run.
    """

    method: str
    points: int
    tolerance: float
    period: float | None
    viscosity: float | None
    period_error: float | None
    viscosity_error: float | None
    period_reported: float | None
    viscosity_reported: float | None
    wall_seconds: float
    evaluations: int
    failure: str | None
    run_key: str


class CriticalBracket(ReportModel):
    """A bracket of the critical Hamaker constant from runs of one tolerance.

    Attributes
    ----------
    tolerance : float
        Tolerance of the time steps of all runs.
    bracket : (float or None, float or None)
        Ends of the bracket.
    status : str
        Status of the search.
    runs : int
        Number of runs.
    run_keys : list of str
        Their keys.
    wall_seconds : float
        Time that all of them took together.
    """

    tolerance: float
    bracket: tuple[float | None, float | None]
    status: str
    runs: int
    run_keys: list[str]
    wall_seconds: float


class WorkPrecision(ReportModel):
    """The whole report.

    Attributes
    ----------
    report : str
        Name of the report.
    machine : Machine
        The computer that made it.
    references : list of ConvergedRun
        One for each scene.
    measurements : list of Measurement
        By scene, method and number of points, from the loosest tolerance to the tightest.
    slopes : list of ObservedOrder
        One for each series of measurements.
    envelopes : list of LeastTime
        One for each scene and error.
    answers : list of DoubletAnswer
        Errors of what users ask for.
    critical_values : list of CriticalBracket
        One for each tolerance.
    """

    report: str = "work-precision"
    machine: Machine
    references: list[ConvergedRun]
    measurements: list[Measurement]
    slopes: list[ObservedOrder]
    envelopes: list[LeastTime]
    answers: list[DoubletAnswer]
    critical_values: list[CriticalBracket]
