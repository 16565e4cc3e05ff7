"""How the sums over points are compiled.

Their inner loops are plain loops that LLVM turns into SIMD code, which needs ``error_model="numpy"`` (no
branch for a division by zero).
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

    By default it keeps to 256 bits on most of them, to spare the clock; sums gain a quarter without.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Past the attributes' own `add`, which knows no attributes with values.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate
