"""How the sums over points are compiled.

Their inner loops are plain loops that LLVM turns into SIMD code.  This needs ``error_model="numpy"``, without
which every division has a branch for zero.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from numba import njit, types
from numba.extending import intrinsic

# Without "ninf" and "nnan": a run that diverges must show it.
compiled = partial(
    njit, cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "arcp"}
)


@intrinsic
def widest_vectors(typing_context: Any) -> Any:
    """Let LLVM use 512-bit vectors in the function that calls this, where the processor has them.

    By default LLVM keeps to 256 bits on most processors, because wider ones lower the clock rate.  Sums
    gain a quarter nevertheless.

    Parameters
    ----------
    typing_context : object
        Given by Numba; a call in compiled code has no arguments.

    Returns
    -------
    tuple
        Signature and code generator, as Numba wants them of an intrinsic.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Past the attributes' own `add`, which knows no attributes with values.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate
