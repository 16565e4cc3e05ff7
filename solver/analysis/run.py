"""What a simulation returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from solver.dimensions import ENERGY_PER_DEPTH, TIME

if TYPE_CHECKING:
    from solver.scene import Scene

Array = NDArray[np.float64]


class Outcome(StrEnum):
    """How a run ended.  `FAILED` is numerical and says nothing about the physics."""

    BOUND = "bound"
    END_TO_END = "end-to-end"
    SEPARATED = "separated"
    EQUILIBRIUM = "equilibrium"
    STEADY = "steady"
    TUMBLING = "tumbling"
    COMPLETED = "completed"
    UNDECIDED = "undecided"
    FAILED = "failed"


class Configuration(StrEnum):
    """How two vesicles that stay together move or touch; see `solver.analysis.configurations`."""

    SLIDING = "sliding"
    ROLLING = "rolling"
    TUMBLING = "tumbling"
    FLAT = "flat"
    MALE_FEMALE = "male-female"
    SIGMOID = "sigmoid"


@dataclass(frozen=True)
class Arrangement:
    """What tells configurations apart: of a pair whose motion has settled, or that has come to rest.

    Attributes
    ----------
    opening : float or None
        Largest over smallest distance of the centers in the last full turn; None at rest.
    own_turns : tuple of float or None
        Revolutions of each vesicle's long axis while the pair makes one; None at rest and for circles.
    bow, twist : float or None
        How far the middle between the membranes departs from a straight line where they are in contact, like
        a bow and like an S, over the length of the contact; None in motion and without contact.
    """

    opening: float | None = None
    own_turns: tuple[float, ...] | None = None
    bow: float | None = None
    twist: float | None = None


@dataclass(frozen=True)
class Viscosity:
    """Intrinsic viscosity [μ] = −∫ f_x y ds/(rate·area) by force, averaged over time.

    The average is over the last full turn of a pair or of a tumbling vesicle and over the second half of a
    run of three or more vesicles; otherwise it is the value of the steady state.  A dilute suspension with
    the area fraction φ has the viscosity 1 + φ·[μ].

    Attributes
    ----------
    total : float
    bending_tension : float
        Of the forces of the membranes.
    adhesion : float or None
        None without adhesion.
    contrast : float or None
        Of fluids inside whose viscosity differs from that outside; None without such.
    """

    total: float
    bending_tension: float
    adhesion: float | None
    contrast: float | None = None


@dataclass(frozen=True)
class Energy:
    """Energies at the end of a run.

    Attributes
    ----------
    bending : float
        ½κ∫curvature² ds over all vesicles.
    adhesion : float or None
        ∫∫φ ds ds over all pairs of vesicles; None without adhesion.
    binding : float or None
        The sum of both at equilibrium, less the bending energy of the same vesicles at rest, each alone.
        Negative where to come together has paid.  None without adhesion, of other states and in old records.
    """

    bending: Annotated[float, ENERGY_PER_DEPTH]
    adhesion: Annotated[float | None, ENERGY_PER_DEPTH]
    binding: Annotated[float | None, ENERGY_PER_DEPTH] = None


LARGEST_SPATIAL = 1e-3

# As large as forces and angles themselves: beyond, a run is not begun.
HOPELESS_SPATIAL = 1.0


@dataclass(frozen=True)
class Errors:
    """Errors of a run, and of its answers.  `solver/README.md`, section 13, says what they mean.

    The first four are the worst of the run.  The others are errors at the end and of answers, None where the
    run has no such answer or its integrator does not propagate errors, and in old records.  That of a period,
    a viscosity or a time is None, too, where it is larger than the answer: it is one to first order.

    Attributes
    ----------
    area : float
        Relative deviation of a vesicle's area from that of the scene.
    closure : float
        |∫(cos θ, sin θ) ds| / length.
    temporal : float
        Sum over the steps of the estimated local error of the state.
    spatial : float
        The largest of: the error of positions that the points leave, by `solver.analysis.spatial_error`; the
        relative error of the single layer across a vesicle's waist; that of adhesion at the smallest gap.
        Beyond `LARGEST_SPATIAL` the points do not resolve the scene.
    global_ : float or None
        Of positions at the end, root mean square; its name in documents is ``global``.
    period : float or None
    inclination_angle : float or None
        Degrees.
    viscosity : float or None
        Of its total.
    time : float or None
        Of the time at which a pair came apart.
    """

    area: float
    closure: float
    temporal: float
    spatial: float
    global_: Annotated[float | None, Field(alias="global")] = None
    period: Annotated[float | None, TIME] = None
    inclination_angle: float | None = None
    viscosity: float | None = None
    time: Annotated[float | None, TIME] = None


@dataclass(frozen=True)
class Work:
    """What a run cost.

    Attributes
    ----------
    steps, rejected_steps : int
    rhs_evaluations : int
        Of the equation of motion.
    jacobian_evaluations, factorizations : int
    wall_seconds : float
    smallest_step : float or None
        Of the accepted ones, in time; None if none was taken.
    points : int or None
        On each vesicle at the end; None in old records.
    tension_iterations : int or None
        None in old records.
    """

    steps: int
    rejected_steps: int
    rhs_evaluations: int
    jacobian_evaluations: int
    factorizations: int
    wall_seconds: float
    smallest_step: float | None = None
    points: int | None = None
    tension_iterations: int | None = None


# Diagnostics by name, each of shape (time,) and sampled at `Series["time"]`; `solver.analysis.recorded` says
# what they measure and in which units.  Always present: time, bending_energy, area_error, closure_error,
# state_rate.  With a protocol: flow_rate.  With two or more vesicles: gap.  With exactly two:
# center_distance, center_angle (of the line of centers, radians, unwrapped).  With adhesion:
# adhesion_energy.  In shear and linear flow: viscosity_bending_tension and, with adhesion,
# viscosity_adhesion and, with a contrast, viscosity_contrast.  With one vesicle: inclination_angle (radians).
# With three or more vesicles and adhesion: clusters (their number, single vesicles included) and
# largest_cluster (vesicles in it); `contacts` says what a cluster is.
Series = Mapping[str, Array]

# What is measured of every vesicle where there are three or more, sampled at `Series["time"]`, by name:
# vesicle_center (time, vesicles, 2), vesicle_inclination_angle (radians) and vesicle_area_error (relative),
# both (time, vesicles); with adhesion vesicle_cluster, the number of its cluster, (time, vesicles).
VesicleSeries = Mapping[str, Array]


@dataclass(frozen=True)
class Frames:
    """Recorded states, all with as many points as the last one.

    Attributes
    ----------
    time : (frames,)
    tangent_angle : (frames, vesicles, points)
    center : (frames, vesicles, 2)
    tension : (frames, vesicles, points)
    """

    time: Array
    tangent_angle: Array
    center: Array
    tension: Array


@dataclass(frozen=True, kw_only=True)
class RunResults:
    """What a finished simulation came to, without what it recorded.  What the scene does not have is None.

    Attributes
    ----------
    scene : Scene
    outcome : Outcome
    failure : str or None
        Why a run failed.
    undecided : str or None
        Why a run is undecided, where its criteria say so.
    time : float
        At the end.
    period : float or None
        Duration of the last full turn.
    settled : bool or None
        Whether the motion repeats itself, so that the period and averages over the last turn are those of
        every later one (`Criteria.settled_change`).  None without a period, and in old records.
    effective_aspect_ratio : float or None
        Of the rigid ellipse with this period in the same flow.
    inclination_angle : float or None
        Degrees.
    gap : float or None
        Smallest distance between two membranes at the end.
    viscosity : Viscosity or None
    energy : Energy
    error : Errors
    work : Work
    sensitive : bool
        Whether the outcome could be another one: a pair would have stayed together or come apart
        with three times the estimated error.
    perturbations : tuple of float
        Times at which the run rested in an unstable state and was perturbed.
    configuration : Configuration or None
        None where none is known: of pairs that have not settled, other numbers of vesicles, in old records.
    arrangement : Arrangement or None
        What it is read from.
    """

    scene: Scene
    outcome: Outcome
    failure: str | None
    time: float
    period: float | None
    effective_aspect_ratio: float | None
    inclination_angle: float | None
    gap: float | None
    viscosity: Viscosity | None
    energy: Energy
    error: Errors
    work: Work
    perturbations: tuple[float, ...] = ()
    sensitive: bool = False
    settled: bool | None = None
    undecided: str | None = None
    configuration: Configuration | None = None
    arrangement: Arrangement | None = None


@dataclass(frozen=True, kw_only=True)
class Run(RunResults):
    """A finished simulation: its results, and what it recorded.

    Attributes
    ----------
    series : Series
        Diagnostics against time.
    frames : Frames
    vesicle_series : VesicleSeries
        Diagnostics of each vesicle against time.
    """

    series: Series
    frames: Frames
    vesicle_series: VesicleSeries = field(default_factory=dict)
