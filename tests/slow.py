"""Which tests of a table are for `make test-all` alone."""

from collections.abc import Sequence

import pytest


def one_of_each_fast(first: Sequence, second: Sequence) -> list:
    """Return all pairs for `parametrize`; slow but for those that hold each value of either."""
    count = min(len(first), len(second))
    return [
        pytest.param(one, other, marks=() if i % count == k % count else pytest.mark.slow)
        for i, one in enumerate(first)
        for k, other in enumerate(second)
    ]
