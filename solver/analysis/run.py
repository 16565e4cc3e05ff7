"""What a simulation returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

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
    UNDECIDED = "undecided"
    FAILED = "failed"


@dataclass(frozen=True)
class Viscosity:
    """Intrinsic viscosity −∫ f_x y ds/(rate·area) by force, averaged over time.

    ``contrast`` is what fluids inside add whose viscosity differs.  No adhesion part without adhesion, and
    none of a contrast without one.

    It is taken over a full turn, the last one, of a pair or of a tumbling vesicle, over the second half of a
    run of three or more vesicles, and otherwise from the steady state.  A suspension with the area fraction φ
    has the viscosity 1 + φ·[μ].
    """

    total: float
    bending_tension: float
    adhesion: float | None
    contrast: float | None = None


@dataclass(frozen=True)
class Energy:
    """Energies at the end: bending ½κ∫curvature² ds over all vesicles, adhesion over all pairs."""

    bending: float
    adhesion: float | None


LARGEST_SPATIAL = 1e-3


@dataclass(frozen=True)
class Errors:
    """Measured error indicators, worst over the run.

    area : relative drift of a vesicle's area.
    closure : |∫(cos θ, sin θ) ds| / length.
    temporal : accumulated local error of the state.
    spatial : the largest of these: amplitude (radians) of the last third of the tangent angle's spectrum;
        relative error of the single layer across a vesicle's waist; that of adhesion at the smallest gap.
        Beyond `LARGEST_SPATIAL` the points do not resolve the scene.
    """

    area: float
    closure: float
    temporal: float
    spatial: float


@dataclass(frozen=True)
class Work:
    """What the run cost."""

    steps: int
    rejected_steps: int
    rhs_evaluations: int
    jacobian_evaluations: int
    factorizations: int
    wall_seconds: float
    smallest_step: float | None = None  # accepted, in time; None if none was taken
    points: int | None = None  # on each vesicle at the end; None in records from before it could change
    tension_iterations: int | None = None  # None in records from before they were counted


# Diagnostics by name, each of shape (time,) and sampled at `Series["time"]`.  Always present: time,
# bending_energy, area_error, closure_error, state_rate.  With two or more vesicles: gap.  With exactly two:
# center_distance, center_angle (of the line of centers, radians, unwrapped).  With adhesion:
# adhesion_energy.  In shear: viscosity_bending_tension and, with adhesion, viscosity_adhesion and, with a
# contrast, viscosity_contrast.  With one vesicle: inclination_angle (radians).  With three or more vesicles
# and adhesion: clusters (their number, single vesicles included) and largest_cluster (vesicles in it);
# `contacts` says what a cluster is.
Series = Mapping[str, Array]

# What is measured of every vesicle where there are three or more, sampled at `Series["time"]`, by name:
# vesicle_center (time, vesicles, 2), vesicle_inclination_angle (radians) and vesicle_area_error (relative),
# both (time, vesicles); with adhesion vesicle_cluster, the number of its cluster, (time, vesicles).
VesicleSeries = Mapping[str, Array]


@dataclass(frozen=True)
class Frames:
    """Recorded states, all with as many points as the last one.

    time : (frames,)
    tangent_angle : (frames, vesicles, points)
    center : (frames, vesicles, 2)
    tension : (frames, vesicles, points)
    """

    time: Array
    tangent_angle: Array
    center: Array
    tension: Array


@dataclass(frozen=True)
class Run:
    """A finished simulation.  Quantities that the scene does not have are None."""

    scene: Scene
    outcome: Outcome
    failure: str | None
    time: float
    period: float | None
    effective_aspect_ratio: float | None
    inclination_angle: float | None  # degrees
    gap: float | None
    viscosity: Viscosity | None
    energy: Energy
    error: Errors
    work: Work
    series: Series
    frames: Frames
    vesicle_series: VesicleSeries = field(default_factory=dict)
