"""Motions that put boundaries through each other."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.clash import clash, jump
from slideviz.case.model import Rotate, Translate
from slideviz.case.motion import displacements
from slideviz.case.samples import sample
from slideviz.errors import CaseError


@pytest.fixture
def square():
    found = sample("square")
    roles = dict.fromkeys(("LEFT", "RIGHT", "LOWER", "UPPER"), "sliding") | {"BLOCK": "moving"}
    return found.mesh, found.case.change(roles=roles, periodic="none", sliding="ps", steps=1)


def moved(case, mesh, *motions):
    case = case.change(motions=motions)
    found = displacements(case, mesh)
    return case, mesh, found.nodes, found.vectors


def test_a_block_in_the_wall_is_told_with_place_and_remedy(square):
    mesh, case = square
    case, *_ = arguments = moved(case, mesh, Translate("BLOCK", (-0.45, 0.0)))
    text = clash(*arguments)
    assert text is not None
    assert text.startswith("the motion puts BLOCK through LEFT near (0, 0.")
    assert "move BLOCK less" in text
    with pytest.raises(CaseError, match="through LEFT near"):
        next(sv.deform(case, mesh))


@pytest.mark.parametrize("vector", [(-0.39, 0.0), (0.0, -0.47), (0.2, 0.3)])
def test_a_block_near_the_wall_is_fine(square, vector):
    mesh, case = square
    arguments = moved(case, mesh, Translate("BLOCK", vector))
    assert clash(*arguments) is None
    assert jump(*arguments) is None


def test_a_periodic_boundary_that_moves_along_may_be_passed(square):
    mesh, case = square
    roles = {**case.roles, "LOWER": "periodic", "UPPER": "periodic"}
    free = case.change(roles=roles, periodic="moving")
    up = Translate("BLOCK", (0.0, 0.49))
    assert clash(*moved(free, mesh, up)) is None
    assert "through UPPER" in clash(*moved(free.change(periodic="periodic"), mesh, up))
    assert "through UPPER" in clash(*moved(case, mesh, up))


def test_a_jump_over_the_wall_is_a_warning(square):
    mesh, case = square
    case, *_ = arguments = moved(case, mesh, Translate("BLOCK", (1.5, 0.0)))
    assert clash(*arguments) is None
    assert "goes through RIGHT" in jump(*arguments)
    *_, last = sv.deform(case, mesh)
    assert any("goes through RIGHT" in text for text in last.warnings)


def test_a_turn_that_cuts_is_told(square):
    mesh, case = square
    near = Translate("BLOCK", (0.0, -0.45))
    assert clash(*moved(case, mesh, near)) is None
    assert "through LOWER" in clash(*moved(case, mesh, near, Rotate("BLOCK", 60.0)))


def test_boundaries_with_common_nodes_are_not_compared():
    found = sample("hexahedron", 5)
    mesh = found.mesh
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"LEFT": "moving"}
    case = found.case.change(roles=roles, periodic="none")
    arguments = moved(case, mesh, Translate("LEFT", (-0.1, 0.0, 0.0)))
    assert clash(*arguments) is None
    inward = moved(case, mesh, Translate("LEFT", (0.5, 0.0, 0.0)))
    assert "through BLOCK" in clash(*inward)
    assert np.array_equal(mesh.points, found.mesh.points)
