"""How rows are shared out among ranks."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from solver.parallel import even_bounds

Array = NDArray[np.float64]


@given(
    cost=st.lists(st.floats(0.1, 100.0), min_size=1, max_size=40).map(np.array),
    size=st.integers(1, 9),
)
def test_shares_are_neighbors_and_even(cost: Array, size: int) -> None:
    bounds = even_bounds(cost, size)
    assert bounds[0] == 0
    assert bounds[-1] == cost.size
    assert np.all(np.diff(bounds) >= 0)
    shares = [cost[first:last].sum() for first, last in pairwise(bounds)]
    assert max(shares) <= cost.sum() / size + cost.max() * (1 + 1e-12)


def test_costly_rows_make_a_share_smaller() -> None:
    assert even_bounds(np.array([4.0, 1.0, 1.0, 1.0, 1.0]), 2).tolist() == [0, 1, 5]
