"""What every imposed flow states about itself.

A flow owns its facts: nothing else in the project asks which flow a scene has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.dimensions import RATE
from solver.model import Model, NonNegative

Array = NDArray[np.float64]


class Symbol(NamedTuple):
    """How the field names a parameter: in words, in TeX without dollar signs, and in plain text."""

    name: str
    tex: str
    text: str


class ImposedFlow(Model, ABC):
    """A velocity that is imposed far from the vesicles and adds to the one that they cause.

    Attributes
    ----------
    kind : str
        Which flow it is.
    rate : float
        Scale of the velocity gradient; the velocity is proportional to it.
    title : str
        The flow in the words of a caption: "2 vesicles in …".
    symbols : mapping from field to Symbol
        The parameters that captions and axes name.
    odd : bool
        Whether velocity(−x) = −velocity(x) when the vesicles' centers are reflected, too.  Only then may a
        pair that a half turn leaves as it is be computed as one vesicle and its image.

    Notes
    -----
    In a flow that `rotates` a pair has a period and is bound when it revolves; a single vesicle may tumble.
    Everywhere it must turn lines of any direction the same way, whose sense is read from the gradient at the
    origin.  Only one that `strains` as well may turn lines of some directions back.

    In a flow that `strains` a pair that rests has an inclination to the axis y.  Along it lines must be
    stretched fastest.

    The `shear_rate` is that of the simple shear with the same rate of strain E, √(2 E:E).  Only a flow with
    the same gradient everywhere may have one.
    """

    kind: str
    rate: Annotated[NonNegative, RATE]

    title: ClassVar[str]
    symbols: ClassVar[Mapping[str, Symbol]]
    odd: ClassVar[bool] = False

    @property
    def rotates(self) -> bool:
        """Whether the flow turns a pair, or a single vesicle, round and round."""
        return False

    @property
    def strains(self) -> bool:
        """Whether a pair may come to rest in the flow, side by side or end to end."""
        return False

    @abstractmethod
    def velocity(self, points: Array, centers: Array) -> Array:
        """Return the velocity at points.

        Parameters
        ----------
        points : (2, ...)
            Positions in units of length; x, then y.
        centers : (2, C)
            Centers of all vesicles.

        Returns
        -------
        (2, ...)
        """

    @abstractmethod
    def velocity_gradient(self, points: Array) -> Array:
        """Return the velocity gradient at points.

        Parameters
        ----------
        points : (2, ...)

        Returns
        -------
        (2, 2, ...)
            Row i holds the derivatives of the velocity's component i by x and y, 1/time.
        """

    def jacobian(self, points: Array, by_state: Array, centers_by_state: Array) -> Array:
        """Return the derivatives of the velocity at points by the state.

        Parameters
        ----------
        points : (2, P)
        by_state : (2, P, S)
            Derivatives of the points by the state.
        centers_by_state : (2, C, S)
            Derivatives of the vesicles' centers by the state; for flows that follow them.

        Returns
        -------
        (2, P, S)
        """
        return np.einsum("ijp,jps->ips", self.velocity_gradient(points), by_state)

    @property
    def comoving(self) -> ImposedFlow | None:
        """The flow in the frame of the mean of the vesicles' centers, if they are computed there.

        It has the same gradient everywhere and vanishes at that mean.  A flow that carries vesicles away ever
        faster states it, as `solver.simulation.moving_frame` says; None for other flows.
        """
        return None

    @property
    def shear_rate(self) -> float | None:
        """Shear rate by which a stress is divided to give a viscosity; None for flows that have none."""
        return None

    def effective_aspect_ratio(self, period: float) -> float | None:
        """Return the aspect ratio of a rigid ellipse that turns with a period, None where there is none.

        Parameters
        ----------
        period : float
            Duration of a full turn, in units of time.

        Returns
        -------
        float or None
        """
        return None
