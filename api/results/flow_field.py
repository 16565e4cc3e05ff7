"""The imposed flow as clients draw it: its velocity on a grid, and how its parameters are named."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Self

import numpy as np
from pydantic import BaseModel

from solver.analysis.run import Array
from solver.flows import ImposedFlow
from solver.scene import Scene

_GRID = 33  # positions along each axis
_MARGIN = 1.0  # around the places of the vesicles, in the largest length of a vesicle


class ParameterName(BaseModel):
    """How a parameter is named, in words and by its symbol in plain text."""

    name: str
    symbol: str


class FlowDescription(BaseModel):
    """What captions say about an imposed flow.

    Attributes
    ----------
    kind : str
        The value of `flow.kind` in a scene.
    title : str
        "2 vesicles in …".
    parameters : dict
        By field of the flow.
    """

    kind: str
    title: str
    parameters: dict[str, ParameterName]

    @classmethod
    def of(cls, flow: type[ImposedFlow]) -> Self:
        """Return the description of a registered flow.

        Parameters
        ----------
        flow : type

        Returns
        -------
        FlowDescription
        """
        parameters = {
            field: ParameterName(name=symbol.name, symbol=symbol.text)
            for field, symbol in flow.symbols.items()
        }
        return cls(kind=flow.model_fields["kind"].default, title=flow.title, parameters=parameters)


class FlowField(BaseModel):
    """The imposed velocity on a grid that holds the vesicles in all recorded states.

    The vesicles' centers are those of the first state, for a flow that follows them.

    Attributes
    ----------
    x, y : list of float
        Positions along the axes, equally spaced, ascending.
    velocity : (2, y, x)
        Components x and y.
    """

    x: list[float]
    y: list[float]
    velocity: list[list[list[float]]]


def flow_field(scene: Scene, centers: Iterable[Array]) -> FlowField | None:
    """Return the imposed velocity around the vesicles of a run.

    Parameters
    ----------
    scene : Scene
    centers : iterable of (frames, vesicles, 2)
        Of the recorded states, piece by piece.

    Returns
    -------
    FlowField or None
        None in a fluid at rest, and if the run has no finite state.
    """
    flow = scene.flow
    if flow is None or flow.rate == 0:
        return None
    first: Array | None = None
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for piece in centers:
        finite = piece[np.isfinite(piece).all(axis=(1, 2))]
        if len(finite):
            first = finite[0] if first is None else first
            low = np.minimum(low, finite.min(axis=(0, 1)))
            high = np.maximum(high, finite.max(axis=(0, 1)))
    if first is None:
        return None
    margin = _MARGIN * max(vesicle.length for vesicle in scene.vesicles)
    x, y = (np.linspace(*ends, _GRID) for ends in zip(low - margin, high + margin, strict=True))
    velocity = flow.velocity(np.stack(np.meshgrid(x, y)), first.T)
    return FlowField(x=x.tolist(), y=y.tolist(), velocity=velocity.tolist())
