"""Units of a scene as they are sent: a client multiplies a number by the size of its unit."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel

from ensemble.config.measured import dimension_at, measured_values, stated_dimension, unit_sizes
from ensemble.store.run_record import RunSummary
from solver.analysis.recorded import RECORDED
from solver.scene import Scene


class UnitSize(BaseModel):
    """How much one is.

    Attributes
    ----------
    value : float
    unit : str
        With a prefix, such as ``µm``.
    """

    value: float
    unit: str


class SceneUnits(BaseModel):
    """How much one is of every number of a scene and of its runs that has a unit.

    Attributes
    ----------
    sizes : dict
        By the dotted path of a field of the scene, or the name of a result or of a diagnostic of a run.
        Empty if the scene does not say what its units are.
    """

    sizes: dict[str, UnitSize]

    @classmethod
    def of(cls, scene: Scene, paths: Iterable[str] = ()) -> SceneUnits:
        """Return the units of a scene.

        Parameters
        ----------
        scene : Scene
        paths : iterable of str
            Dotted paths of fields that the document of the scene names otherwise, such as those of all
            vesicles together.

        Returns
        -------
        SceneUnits
        """
        dimensions = {
            **{name: stated_dimension(RunSummary, name) for name in RunSummary.model_fields},
            **{name: each.dimension for name, each in RECORDED.items()},
            **{path: dimension_at(scene, path) for path in paths},
        }
        ones = {name: (1.0, dimension) for name, dimension in dimensions.items()}
        sizes = unit_sizes(scene, scene.model_dump(), scene.units) | measured_values(ones, scene.units)
        return cls(sizes={name: UnitSize(**each._asdict()) for name, each in sizes.items()})
