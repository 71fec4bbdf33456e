"""What a step is computed from has the same bits however nodes and cells are numbered.

Where nodes nearly coincide a system multiplies rounding by its condition number, so that equal but
for rounding is not enough.
"""

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Scale
from slideviz.mesh.topology import find_boundary
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from tests import builders
from tools.laws.meshes import renumbered

MESHES = {
    "square": (lambda: builders.square(11, "mixed"), "BLOCK", ("y_m", "y_p")),
    "cube": (lambda: builders.cube(5, "mixed"), "BLOCK", ("y_m", "y_p")),
    "sector": (lambda: builders.sector(7, 37.0), "BLOCK", ("per1", "per2")),
    "passage": (lambda: builders.passage((3, 5, 4), 37.0), "blade", ("per1", "per2")),
}


@pytest.mark.parametrize("kind", MESHES)
@pytest.mark.parametrize("seed", range(3))
def test_frame_motion_and_normals_keep_every_bit(kind, seed):
    make, moving, sides = MESHES[kind]
    mesh, rng = make(), np.random.default_rng(seed)
    points = mesh.points + rng.uniform(size=mesh.dim)
    origin = np.zeros(3)
    origin[: mesh.dim] = points[0] - mesh.points[0]
    mesh = mesh.with_points(points)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | dict.fromkeys(sides, "periodic")
    case = Case(
        roles=roles | {moving: "moving"},
        motions=(Rotate(moving, 3.0), Scale(moving, (1.01,))),
        sliding="ds",
        periodic="moving",
        origin=tuple(origin),
    )
    other, order = renumbered(mesh, rng)
    one, two = make_setup(prepare(case, mesh)), make_setup(prepare(case, other))
    features = [setup.frame.features(setup.coords) for setup in (one, two)]
    assert features[0][:, order].tobytes() == features[1].tobytes()
    asked = np.zeros((2, *mesh.points.shape))
    normals = np.zeros((2, len(mesh.points), mesh.dim, mesh.dim))
    for row, setup in enumerate((one, two)):
        asked[row, setup.known] = setup.target
        nodes, found = setup.constraints(setup.coords)
        turn = np.arange(len(nodes)) - np.searchsorted(nodes, nodes)
        normals[row, nodes, turn] = found
    assert (asked[0, order] == asked[1]).all()
    assert (normals[0, order] == normals[1]).all()


@pytest.mark.parametrize("kind", ["cube", "passage"])
def test_edges_have_the_same_direction(kind):
    """A closest point on an edge is rounded from its first end on."""
    mesh = MESHES[kind][0]()
    other, order = renumbered(mesh, np.random.default_rng(0))
    one = {tuple(row) for row in find_boundary(mesh).joint_nodes.tolist()}
    two = {tuple(row) for row in order[find_boundary(other).joint_nodes].tolist()}
    assert one == two
