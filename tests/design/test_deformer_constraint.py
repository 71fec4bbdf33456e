"""Numbers of the deformed mesh as constraints of an optimiser, with exact derivatives."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.limits import NUMBERS
from slideviz.design.deformer import CONSTRAINTS
from slideviz.errors import CaseError
from slideviz.mesh.quality_derivative import cell_margins
from tests.design.test_deformer_derivatives import REDUCED, alike, motions, wave
from tests.test_laws import box, box_case, sector, sector_case

pytestmark = pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")
CASES = [
    ("box", 2, ("none", "none"), {}),
    ("box", 2, ("ps", "none"), {"steps": 3, "reduction": REDUCED}),
    ("box", 3, ("ds", "none"), {}),
    ("box", 2, ("ps", "none"), {"layers": "keep", "layer_thickness": 0.15, "relax": "yes"}),
    ("sector", 2, ("ps", "moving"), {"steps": 2}),
]


def deformer_of(shape, dim, method, settings):
    if shape == "sector":
        mesh = sector(dim)
        case = sector_case(mesh, method, motions(mesh, "BLOCK" if dim == 2 else "blade"))
    else:
        mesh = box(dim)
        case = box_case(mesh, method, motions(mesh, "BLOCK"))
    return sv.Deformer(mesh, case.change(**settings))


@pytest.mark.parametrize(("shape", "dim", "method", "settings"), CASES)
def test_derivatives_are_exact_forward_and_reverse(shape, dim, method, settings):
    deformer = deformer_of(shape, dim, method, settings)
    design = alike(deformer, 1.2 * deformer.displacement)
    direction = alike(deformer, wave(deformer.mesh.points[deformer.nodes]))
    step = 1e-6 * deformer.mesh.extent
    for name in CONSTRAINTS:
        found = deformer.constraint(name, design, p=12.0)
        forward, gradient = found.jvp(direction), found.vjp()
        assert abs(forward) > 1e-6
        assert forward == pytest.approx(float(np.vdot(gradient, direction)), rel=1e-10)
        np.testing.assert_allclose(found.vjp(-3.0), -3.0 * gradient, rtol=1e-10, atol=1e-12)
        ahead, behind = (
            deformer.constraint(name, design + s * direction, p=12.0).value for s in (step, -step)
        )
        assert forward == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)


def test_the_values_are_those_of_the_mesh_and_never_above_the_minimum():
    deformer = deformer_of("box", 2, ("ps", "none"), {})
    mesh = deformer.mesh.with_points(deformer.deform())
    found = sv.quality(mesh, deformer.mesh)
    least = {
        "min": found.min,
        "mean": found.mean,
        "margin": cell_margins(mesh, deformer.mesh).min(),
    }
    assert set(CONSTRAINTS) == set(least) <= set(NUMBERS)
    for name, value in least.items():
        assert 0.9 * value <= deformer.constraint(name).value <= value
        sharp = deformer.constraint(name, p=2000.0).value
        assert sharp == pytest.approx(value, rel=1e-3)


def test_a_number_without_derivatives_is_told():
    deformer = deformer_of("box", 2, ("none", "none"), {})
    with pytest.raises(CaseError, match=r"constraint: 'growth' is not one of min \| mean \| marg"):
        deformer.constraint("growth")
