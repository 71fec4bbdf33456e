"""Real meshes, deformed a little by the methods to compare with; skipped where they are absent."""

from __future__ import annotations

import pytest

from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from tests import test_real_meshes as real

pytestmark = real.pytestmark

# A passage a thousand times thinner than long: 300 iterations reach 2e-7, and the run says so.
THIN = ("stage", "elastic")
QUICK = ("rotating ring", "adapted square", "pin")

MODES = [
    pytest.param(
        *(name, method, "moving" if pair else "none"),
        marks=[pytest.mark.slow] if method == "elastic" and name not in QUICK else [],
    )
    for name, (*_, pair, _kind, _axis) in real.CASES.items()
    for method in ("idw", "elastic")
    if (name, method) != THIN
]


@pytest.mark.parametrize(("name", "method", "periodic"), MODES)
def test_boundaries_are_kept_and_images_move_alike(name, method, periodic):
    sliding = "ds" if method == "elastic" else "ps"
    mesh, case = real.make_case(name, sliding, periodic)
    case = case.change(method=method, reduction=None)
    known = ("halo copy", "no longer fits")
    found = make_setup(prepare(case, mesh)).warnings
    assert all(any(words in text for words in known) for text in map(str, found))
    real.check(mesh, case, real.load(real.CASES[name][0])[1])
