"""The scenes of the work-precision report: short, and all ending at their horizon to be compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from solver.scene import Criteria, Output, PowerLaw, Scene, Shear, Trap, Vesicle


def _to_the_horizon(scene: Scene) -> Scene:
    """Return the scene so that nothing ends it before or after its horizon, recorded at both ends only."""
    return scene.model_copy(
        update={
            "criteria": Criteria(steady_time=2 * scene.horizon),
            "output": Output(interval=scene.horizon, frame_interval=scene.horizon),
        }
    )


_TILT = 0.05  # radians, of the line of centers of the trapped pair: enough to turn within the horizon

SHORT_SCENES: Mapping[str, Scene] = MappingProxyType(
    {
        name: _to_the_horizon(scene)
        for name, scene in {
            "doublet in shear": Scene(
                horizon=20.0,
                vesicles=(Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.0))),
                adhesion=PowerLaw(hamaker=1.5, distance=0.4),
                flow=Shear(rate=0.5),
            ),
            "doublet in a trap": Scene(
                horizon=20.0,
                vesicles=tuple(
                    Vesicle(
                        reduced_area=0.8,
                        center=(-side * math.sin(_TILT), side * math.cos(_TILT)),
                        angle=_TILT,
                    )
                    for side in (-1.1, 1.1)
                ),
                adhesion=PowerLaw(hamaker=0.7, distance=0.4),
                flow=Trap(rate=0.09),
            ),
            "collision at rest": Scene(
                horizon=20.0,
                vesicles=(Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.3), angle=1.2)),
                adhesion=PowerLaw(hamaker=1.5, distance=0.4),
            ),
            "vesicle in shear": Scene(horizon=20.0, vesicles=(Vesicle(),), flow=Shear(rate=0.5)),
        }.items()
    }
)
