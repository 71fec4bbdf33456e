"""Which boundaries a span goes between, and about which axis."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.spans import span_ends, span_field
from slideviz.errors import CaseError
from tests.builders import cube, passage

SIDES = {"per1": "periodic", "per2": "periodic"}


def renamed(mesh, **names):
    markers = (sv.Marker(names.get(m.name, m.name), m.cells) for m in mesh.markers)
    return sv.Mesh(mesh.points, mesh.cells, tuple(markers), name=mesh.name)


def test_hub_and_shroud_are_those_of_the_key_or_of_their_names():
    mesh = passage((2, 4, 4))
    assert span_ends(sv.Case(), mesh) == ("hub", "shroud")
    assert span_ends(sv.Case(), renamed(mesh, hub="R1_HUB", shroud="Casing")) == (
        "R1_HUB",
        "Casing",
    )
    assert span_ends(sv.Case(span=("shroud", "hub")), mesh) == ("shroud", "hub")
    with pytest.raises(CaseError, match=r"SPAN: .* has no marker 'hup'; did you mean hub"):
        span_ends(sv.Case(span=("hup", "shroud")), mesh)
    with pytest.raises(
        CaseError, match=r"hub: hub, per1_hub; shroud or casing: none.*SPAN= \( HUB"
    ):
        span_ends(sv.Case(), renamed(mesh, per1="per1_hub", shroud="top"))


def test_the_field_has_the_axis_of_the_period_or_of_the_case():
    mesh = passage((2, 4, 4))
    case = sv.Case(roles=SIDES, periodic_type="rotational")
    field = span_field(case, mesh)
    assert field is span_field(case.change(steps=7), mesh)
    assert field.axis == (0.0, 0.0, 1.0)
    coords = field.meridional(mesh.points)
    assert field.span(coords)[0] == pytest.approx((coords[:, 1] - 0.5) / 0.5, abs=1e-12)
    # Without periodic sides: the axis of the case.
    moved = mesh.with_points(mesh.points + np.array([1.0, 2.0, 3.0]))
    other = span_field(sv.Case(origin=(1.0, 2.0, 3.0)), moved)
    assert np.abs(other.meridional(moved.points) - coords).max() < 1e-12


def test_a_cascade_has_no_axis():
    case = sv.Case(roles={"y_m": "periodic", "y_p": "periodic"}, span=("z_m", "z_p"))
    with pytest.raises(CaseError, match=r"repeats by a translation .*so it has no axis"):
        span_field(case, cube(4, block=False))
