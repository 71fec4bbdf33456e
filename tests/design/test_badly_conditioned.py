"""Systems that have lost nearly all digits: as good as a run, and said, against 50 digits."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case, Translate
from slideviz.errors import ConditionWarning
from tests import builders

EXACT = np.vectorize(lambda number: Decimal(float(number)), otypes=[object])


def interpolated(points, controls, values, radius):
    """Wendland's C2 interpolant at all points of the values at controls, with 50 digits."""
    with localcontext() as context:
        context.prec = 50
        x, c, radius = EXACT(points), EXACT(controls), Decimal(float(radius))

        def phi(a, b):
            square = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
            q = np.vectorize(lambda s: s.sqrt() / radius, otypes=[object])(square)
            return np.maximum(1 - q, Decimal(0)) ** 4 * (4 * q + 1)

        system, right = phi(c, c), EXACT(values)
        for k in range(len(c)):
            part = system[k + 1 :, k] / system[k, k]
            system[k + 1 :] -= part[:, None] * system[k]
            right[k + 1 :] -= part[:, None] * right[k]
        weights = np.empty_like(right)
        for k in reversed(range(len(c))):
            weights[k] = (right[k] - system[k, k + 1 :] @ weights[k + 1 :]) / system[k, k]
        return (phi(x, c) @ weights).astype(float)


def test_a_deformer_is_as_good_as_a_run_and_says_that_this_is_little():
    mesh = builders.layered(8, 2e-5)
    roles = dict.fromkeys(mesh.marker_names, "moving")
    case = Case(roles=roles, motions=tuple(Translate(name, (0.01, 0.02)) for name in roles))
    *_, last = sv.deform(case, mesh)
    with pytest.warns(ConditionWarning, match="and points between the boundary nodes"):
        deformer = sv.Deformer(mesh, case)
    radius = deformer._setup.basis.radius
    x = mesh.points
    designs = [
        deformer.displacement,
        0.01 * np.sin(2 * x[deformer.nodes]),
        0.02 * x[deformer.nodes, ::-1] ** 2,
    ]
    exact = interpolated(x, x[deformer.nodes], np.hstack(designs), radius)
    exact = x + exact.reshape(len(x), 3, 2).swapaxes(0, 1)
    errors = [np.abs(deformer.deform(u) - e).max() for u, e in zip(designs, exact, strict=True)]
    of_run = np.abs(last.mesh.points - exact[0]).max()
    assert errors[0] <= max(4 * of_run, 1e-11)
    assert max(errors) < 1e-6
    # Derivatives are refined too, forward and in reverse alike.
    change = deformer.jvp(designs[0], designs[1])
    assert np.abs(change - (exact[1] - x)).max() < 1e-6
    back = deformer.vjp(designs[0], change)
    assert (back * designs[1]).sum() == pytest.approx((change**2).sum(), rel=1e-6)
