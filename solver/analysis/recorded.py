"""What is recorded in a run, and what follows from it: what each array measures, and in which unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from solver.dimensions import (
    ANGLE,
    ENERGY_PER_DEPTH,
    FORCE_PER_AREA,
    LENGTH,
    NUMBER,
    RATE,
    TENSION,
    TIME,
    Dimension,
)


class Recorded(NamedTuple):
    """An array of a run.

    Attributes
    ----------
    description : str
    dimension : Dimension
    """

    description: str
    dimension: Dimension


# By the names that the arrays have in `solver.analysis.run` and in files.
RECORDED: Final[Mapping[str, Recorded]] = {
    "time": Recorded("time of the diagnostics", TIME),
    "frame_time": Recorded("time of the recorded states", TIME),
    "tangent_angle": Recorded("tangent angle of the membranes, by equal arclength", ANGLE),
    "center": Recorded("centers of the membranes", LENGTH),
    "tension": Recorded("membrane tension", TENSION),
    "x": Recorded("x of the points of the membranes", LENGTH),
    "y": Recorded("y of the points of the membranes", LENGTH),
    "bending_force": Recorded("force per area on the fluid by bending", FORCE_PER_AREA),
    "tension_force": Recorded("force per area on the fluid by tension", FORCE_PER_AREA),
    "adhesion_force": Recorded("force per area on the fluid by adhesion", FORCE_PER_AREA),
    "bending_energy": Recorded("bending energy of all vesicles", ENERGY_PER_DEPTH),
    "adhesion_energy": Recorded("adhesion energy of all pairs", ENERGY_PER_DEPTH),
    "area_error": Recorded("largest relative drift of a vesicle's area", NUMBER),
    "closure_error": Recorded("largest gap in a membrane over its length", NUMBER),
    "state_rate": Recorded("largest rate of change of a tangent angle or center", RATE),
    "flow_rate": Recorded("rate of the flow", RATE),
    "gap": Recorded("smallest distance between two membranes", LENGTH),
    "center_distance": Recorded("distance of the two centers", LENGTH),
    "center_angle": Recorded("angle of the line of centers, unwrapped", ANGLE),
    "inclination_angle": Recorded("angle of the long axis against x", ANGLE),
    "viscosity_bending_tension": Recorded("intrinsic viscosity by bending and tension", NUMBER),
    "viscosity_adhesion": Recorded("intrinsic viscosity by adhesion", NUMBER),
    "viscosity_contrast": Recorded("intrinsic viscosity by the viscosity contrast", NUMBER),
    "clusters": Recorded("number of clusters, single vesicles included", NUMBER),
    "largest_cluster": Recorded("vesicles in the largest cluster", NUMBER),
    "vesicle_center": Recorded("center of each vesicle", LENGTH),
    "vesicle_inclination_angle": Recorded("angle of each long axis against x", ANGLE),
    "vesicle_area_error": Recorded("relative drift of each area", NUMBER),
    "vesicle_cluster": Recorded("number of the cluster of each vesicle", NUMBER),
}
