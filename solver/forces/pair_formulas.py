"""The formulas of pair potentials, compiled into the loops over pairs of points.

A loop is compiled once for every formula that it is called with, as if the formula stood in it.  What it is
called with is a `PairFormula`, whose type in compiled code holds the formula's name and a digest of its code.
That is all that Numba's cache on disk knows of it, so that an edited formula is compiled anew.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from numba import types
from numba.extending import NativeValue, models, overload, register_model, typeof_impl, unbox

from solver.compilation import compiled
from solver.pair_potentials.cutoff import truncate

if TYPE_CHECKING:
    from solver.pair_potentials.pair_potential import Derivatives, Formula, PairPotential

_FORMULAS: dict[str, Formula] = {}  # by the name that their types have


class PairFormula:
    """The formula of a potential, as an argument of compiled loops.

    Parameters
    ----------
    formula : callable
        `PairPotential.formula`.
    truncated : bool
        Whether the potential ends at a cutoff.
    """

    def __init__(self, formula: Formula, truncated: bool) -> None:
        name = _name(formula)
        _FORMULAS[name] = formula
        self._numba_type_ = _FormulaType(name, truncated)  # where Numba looks for it first


def formula_and_parameters(potential: PairPotential) -> tuple[PairFormula, tuple[Any, ...]]:
    """Return what compiled loops are given for a potential.

    Parameters
    ----------
    potential : PairPotential

    Returns
    -------
    formula : PairFormula
    parameters : tuple
        The arguments of `derivatives`.
    """
    if potential.cutoff is None:
        return PairFormula(potential.formula, False), potential.parameters
    parameters = (potential.distance, potential.cutoff, potential.parameters)
    return PairFormula(potential.formula, True), parameters


def derivatives(formula: PairFormula, square: float, parameters: Any) -> Derivatives:
    """Compute φ/H and its first and second derivative by q = r², in compiled code only.

    Parameters
    ----------
    formula : PairFormula
    square : float
        q, length².
    parameters : tuple
        See `formula_and_parameters`.

    Returns
    -------
    tuple of three floats

    Raises
    ------
    NotImplementedError
        Outside of compiled code; there `PairPotential.evaluate` does this.
    """
    raise NotImplementedError("only compiled loops call this; elsewhere use PairPotential.evaluate")


class _FormulaType(types.Type):
    """The type of a `PairFormula` in compiled code."""

    def __init__(self, formula: str, truncated: bool) -> None:
        self.formula = formula
        self.truncated = truncated
        super().__init__(name=f"PairFormula({formula}, {_name(truncate) if truncated else 'whole'})")


register_model(_FormulaType)(models.OpaqueModel)


@typeof_impl.register(PairFormula)
def _(formula: PairFormula, context: Any) -> _FormulaType:
    return formula._numba_type_


@unbox(_FormulaType)
def _(formula_type: Any, formula: Any, context: Any) -> NativeValue:
    return NativeValue(context.context.get_dummy_value())  # the type says all


@overload(derivatives, strict=False, jit_options={"forceinline": True})
def _(formula: Any, square: Any, parameters: Any) -> Callable[..., Derivatives]:
    own = _compiled(_FORMULAS[formula.formula])
    if not formula.truncated:
        return lambda formula, square, parameters: own(square, parameters)

    cut = _compiled(truncate)

    def truncated(formula: Any, square: float, parameters: Any) -> Derivatives:
        distance, cutoff, of_the_potential = parameters
        value, first, second = own(square, of_the_potential)
        result: Derivatives = cut(square, distance, cutoff, value, first, second)
        return result

    return truncated


@cache
def _compiled(function: Callable[..., Derivatives]) -> Callable[..., Derivatives]:
    dispatcher: Callable[..., Derivatives] = compiled(function)
    return dispatcher


@cache
def _name(function: Callable[..., Derivatives]) -> str:
    code, constants = function.__code__, inspect.getclosurevars(function).globals
    text = repr((code.co_code, code.co_consts, sorted(constants.items())))
    return f"{function.__module__}.{function.__qualname__} {hashlib.sha256(text.encode()).hexdigest()[:16]}"
