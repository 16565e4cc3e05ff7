"""Coefficients of Rodas5P, a stiffly accurate, L-stable Rosenbrock method of order 5 with 8 stages.

It keeps order 4 or more on stiff parabolic problems (Steinebach 2023).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.integrators.control import AdaptiveStep, EmbeddedError
from solver.integrators.integrator import InitialValueProblem, Integrator, register
from solver.integrators.one_step import OneStepIntegrator
from solver.integrators.rosenbrock import Rosenbrock, Tableau

if TYPE_CHECKING:
    from solver.scene import Numerics

_STAGE = np.zeros((8, 8))
_STAGE[1, :1] = [3.0]
_STAGE[2, :2] = [2.849394379747939, 0.45842242204463923]
_STAGE[3, :3] = [-6.954028509809101, 2.489845061869568, -10.358996098473584]
_STAGE[4, :4] = [2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641]
_STAGE[5:, :5] = [
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
]
_STAGE[6:, 5] = 1.0
_STAGE[7:, 6] = 1.0

_COUPLING = np.zeros((8, 8))
_COUPLING[1, :1] = [-14.155112264123755]
_COUPLING[2, :2] = [-17.97296035885952, -2.859693295451294]
_COUPLING[3, :3] = [147.12150275711716, -1.41221402718213, 71.68940251302358]
_COUPLING[4, :4] = [165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306]
_COUPLING[5, :5] = [
    24.854864614690072,
    -3.0009227002832186,
    47.4931110020768,
    5.5814197821558125,
    -0.6610691825249471,
]
_COUPLING[6, :6] = [
    30.91273214028599,
    -3.1208243349937974,
    77.79954646070892,
    34.28646028294783,
    -19.097331116725623,
    -28.087943162872662,
]
_COUPLING[7, :7] = [
    37.80277123390563,
    -3.2571969029072276,
    112.26918849496327,
    66.9347231244047,
    -40.06618937091002,
    -54.66780262877968,
    -9.48861652309627,
]

_DENSE = [
    [
        25.948786856663858,
        -2.5579724845846235,
        10.433815404888879,
        -2.3679251022685204,
        0.524948541321073,
        1.1241088310450404,
        0.4272876194431874,
        -0.17202221070155493,
    ],
    [
        -9.91568850695171,
        -0.9689944594115154,
        3.0438037242978453,
        -24.495224566215796,
        20.176138334709044,
        15.98066361424651,
        -6.789040303419874,
        -6.710236069923372,
    ],
    [
        11.419903575922262,
        2.8879645146136994,
        72.92137995996029,
        80.12511834622643,
        -52.072871366152654,
        -59.78993625266729,
        -0.15582684282751913,
        4.883087185713722,
    ],
]

RODAS5P = Tableau(
    order=5, diagonal=0.21193756319429014, stage=_STAGE, coupling=_COUPLING, dense=np.array(_DENSE)
)


@register("rosenbrock")
def rodas5p(problem: InitialValueProblem, numerics: Numerics) -> Integrator:
    """Make the Rosenbrock method that a scene asks for.

    Parameters
    ----------
    problem : InitialValueProblem
        With the exact Jacobian.
    numerics : Numerics

    Returns
    -------
    Integrator
    """
    control = AdaptiveStep(EmbeddedError(numerics.tolerance, RODAS5P.order), numerics.tolerance)
    return OneStepIntegrator(Rosenbrock(RODAS5P), control, problem)
