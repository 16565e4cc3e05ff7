"""The threads of the linear algebra library (BLAS)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

# What the libraries read when they are loaded.
_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "OMP_NUM_THREADS")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Give BLAS one thread within the block, unless the environment states a number.

    The matrices of a scene are small: several threads would spend most of the time waiting for each other.
    """
    if any(variable in os.environ for variable in _VARIABLES):
        yield
        return
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """Return the loaded libraries, NumPy's and SciPy's; to find them takes milliseconds."""
    return ThreadpoolController()
