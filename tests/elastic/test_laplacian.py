"""The preconditioner of relaxation."""

import numpy as np
import pytest
from scipy.linalg import cho_solve

from slideviz.elastic.laplacian import _factor


@pytest.mark.parametrize("rounding", [0.0, 1e-13, 1e-9, 1e-6])
@pytest.mark.parametrize("scale", [1.0, 1e10])
def test_a_coarse_matrix_that_rounding_made_indefinite_has_a_factor(rounding, scale):
    # The Laplacian of a chain whose ends are free is singular; a number less is indefinite.
    chain = 2.0 * np.eye(40) - np.eye(40, k=1) - np.eye(40, k=-1)
    chain[[0, -1], [0, -1]] = 1.0
    sizes = np.geomspace(1.0, np.sqrt(scale), 40)
    dense = (chain - rounding * np.eye(40)) * np.outer(sizes, sizes)

    factor = _factor(dense)

    solved = cho_solve(factor, np.eye(40))
    assert np.isfinite(solved).all()
    assert np.linalg.eigvalsh((solved + solved.T) / 2.0 * np.outer(sizes, sizes)).min() > 0.0
