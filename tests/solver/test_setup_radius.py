"""The support radius that INFLUENCE_FACTOR= AUTO finds."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.keys import KEYS
from slideviz.case.moving_nodes import displacements
from slideviz.errors import ArgumentError
from slideviz.solver.prepare import prepare
from slideviz.solver.prescribed import BODIES, DISPLACEMENTS, EXTENTS, moving_bodies
from slideviz.solver.setup import make_setup
from tests.builders import far_field


def radius(mesh, *motions, **values):
    """Return the support radius of a case where the given motions move their markers."""
    roles = {name: "moving" for motion in motions for name in (motion.marker,)}
    return make_setup(prepare(sv.Case(roles=roles, motions=motions, **values), mesh)).basis.radius


def test_a_small_body_has_a_radius_of_fifteen_times_its_size():
    mesh = far_field(60.0)
    body = np.ptp(mesh.points[mesh.marker("body").nodes], axis=0).max()
    assert radius(mesh, sv.Rotate("body", 20.0)) == BODIES * body
    assert radius(mesh, sv.Translate("body", (2.0, 0.0))) == DISPLACEMENTS * 2.0
    assert radius(mesh, sv.Translate("body", (0.3, 20.0))) == EXTENTS * mesh.extent


def test_a_body_that_fills_the_mesh_keeps_two_and_a_half_extents():
    mesh = far_field(2.0)
    assert radius(mesh, sv.Rotate("body", 5.0)) == 2.5 * mesh.extent


def test_a_case_that_says_a_radius_has_it():
    mesh = far_field(60.0)
    move = sv.Rotate("body", 20.0)
    assert radius(mesh, move, influence_factor=0.5) == 0.5 * mesh.extent
    assert radius(mesh, move, influence_factor=0.5, support_radius=3.0) == 3.0
    assert radius(mesh, move, influence_factor="auto") == radius(mesh, move)


def test_only_bodies_that_are_displaced_count():
    mesh = far_field(60.0, bodies=2)
    both = sv.Case(
        roles={"body": "moving", "other": "moving"},
        motions=(sv.Translate("body", (0.1, 0.0)), sv.Translate("other", (0.0, 0.0))),
    )
    setup = make_setup(prepare(both, mesh))
    body = np.ptp(mesh.points[mesh.marker("body").nodes], axis=0).max()
    assert setup.basis.radius == BODIES * body
    still = both.change(motions=(sv.Translate(("body", "other"), (0.0, 0.0)),))
    boxes = moving_bodies(still, mesh, displacements(still, mesh))
    other = np.ptp(mesh.points[mesh.marker("other").nodes], axis=0).max()
    assert len(boxes) == 2
    assert make_setup(prepare(still, mesh)).basis.radius == BODIES * max(body, other)


def test_one_marker_of_two_bodies_is_two_bodies():
    mesh = far_field(60.0, bodies=2)
    one = mesh.marker("body"), mesh.marker("other")
    joined = sv.Marker("both", sv.Cells.from_blocks([(3, m.cells.by_type[3][1]) for m in one]))
    rest = tuple(m for m in mesh.markers if m.name not in ("body", "other"))
    together = sv.Mesh(mesh.points, mesh.cells, (*rest, joined))
    size = max(np.ptp(mesh.points[m.nodes], axis=0).max() for m in one)
    assert radius(together, sv.Translate("both", (0.1, 0.0))) == BODIES * size


def test_a_word_that_is_not_auto_is_told():
    with pytest.raises(ArgumentError, match="influence_factor is 'large'; expected a number"):
        sv.Case(influence_factor="large")


def test_the_factor_of_a_case_replaces_its_length_and_a_file_keeps_either(tmp_path):
    path = tmp_path / "a.cfg"
    sv.Case(support_radius=3.0).write(path)
    assert sv.Case.read(path).support_radius == 3.0
    assert "INFLUENCE_FACTOR= AUTO\n" in path.read_text()
    case = KEYS["INFLUENCE_FACTOR"].put(sv.Case(support_radius=3.0), 0.5)
    assert (case.influence_factor, case.support_radius) == (0.5, None)


def test_a_deformer_keeps_the_radius_of_its_reference():
    mesh = far_field(60.0, bodies=2)
    sizes = [np.ptp(mesh.points[mesh.marker(m).nodes], axis=0).max() for m in ("body", "other")]
    case = sv.Case(roles={"body": "moving", "other": "moving"})
    both = case.change(motions=(sv.Translate(("body", "other"), (0.1, 0.0)),))
    deformer = sv.Deformer(mesh, both)
    own = np.isin(deformer.nodes, mesh.marker("body").nodes)
    small = np.where(own[:, None], (-0.1, 0.0), 0.0)

    def found(displacements):
        return sv.Deformer(mesh, case, displacements)._setup.basis.radius

    assert found(small) == BODIES * sizes[0]
    assert found(np.zeros_like(small)) == BODIES * max(sizes)
    assert found(np.stack([small, 0.01 + 0.1 * small])) == BODIES * max(sizes)
    assert found(np.stack([small, 30.0 * small])) == DISPLACEMENTS * 3.0
    # A design that goes farther has the same radius.
    kept = sv.Deformer(mesh, case, small)
    radius = kept._setup.basis.radius
    fixed = case.change(support_radius=radius, motions=(sv.Translate("body", (-1.0, 0.0)),))
    fixed = fixed.change(motions=(*fixed.motions, sv.Translate("other", (0.0, 0.0))))
    expected = [*sv.deform(fixed, mesh)][-1].mesh.points
    np.testing.assert_allclose(kept.deform(10.0 * small), expected, atol=1e-11)
