"""IDWarp's names: what ADflow and DAFoam call on a mesh, with dot products for the derivatives."""

import h5py
import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.errors import CaseError
from slideviz.idwarp import USMesh
from tests.builders import grid
from tests.cgns_files import passage_grid, save_passage

HOLE = ((2, 4), (2, 4), (2, 4))


def case_of(mesh, **values):
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving", "x_m": "fixed"}
    return Case(roles=roles, sliding="ps", **values)


def warped(dim=3, **values):
    """Return the mesh of IDWarp's names, and the one that it is made from."""
    mesh = grid((6,) * dim, hole=HOLE[:dim])
    return USMesh({"gridFile": mesh, "case": case_of(mesh, **values)}), mesh


def facets(mesh, *names):
    """Return points and connectivity as a solver has them: each facet with nodes of its own."""
    nodes = [
        row for name in names for _, t in mesh.marker(name).cells.by_type.values() for row in t
    ]
    sizes = [len(row) for row in nodes]
    flat = np.concatenate(nodes)
    return mesh.points[flat], np.arange(len(flat)), np.array(sizes), flat


def shaken(points, amount=0.02):
    """Return points moved by a smooth motion, so that copies of a node move alike."""
    shift = amount * np.sin(3 * points[:, ::-1] + np.arange(points.shape[1]))
    return points + shift


@pytest.mark.parametrize("dim", [2, 3])
def test_a_surface_of_facets_deforms_as_the_deformer_does(dim):
    warp, mesh = warped(dim)
    pts, conn, sizes, flat = facets(mesh, "BLOCK")
    warp.setSurfaceDefinition(pts, conn, sizes)
    np.testing.assert_array_equal(warp.getSurfaceCoordinates(), pts)
    warp.setSurfaceCoordinates(shaken(pts))
    np.testing.assert_array_equal(warp.getSolverGrid(), mesh.points.ravel())
    warp.warpMesh()
    nodes = np.unique(flat)
    start = mesh.points[nodes]
    deformer = sv.Deformer(mesh, case_of(mesh), np.zeros_like(start))
    expected = deformer.deform(shaken(start) - start)
    np.testing.assert_allclose(warp.getSolverGrid(), expected.ravel(), rtol=0, atol=1e-14)
    np.testing.assert_allclose(warp.getWarpGrid().reshape(-1, dim)[flat], shaken(pts), atol=1e-13)
    np.testing.assert_array_equal(warp.getSurfaceCoordinates(), shaken(pts))


def test_without_a_definition_the_surface_is_that_of_the_moving_nodes():
    warp, mesh = warped()
    nodes = mesh.marker("BLOCK").nodes
    np.testing.assert_array_equal(warp.getSurfaceCoordinates(), mesh.points[np.sort(nodes)])


def test_the_solver_has_its_own_order_and_may_have_coordinates_twice():
    warp, mesh = warped()
    rng = np.random.default_rng(0)
    indices = rng.integers(0, mesh.points.size, 2 * mesh.points.size)
    warp.setExternalMeshIndices(indices)
    warp.setSurfaceCoordinates(shaken(warp.getSurfaceCoordinates()))
    warp.warpMesh()
    np.testing.assert_array_equal(warp.getSolverGrid(), warp.getWarpGrid()[indices])
    np.testing.assert_array_equal(warp.getCommonGrid(), warp.getWarpGrid())


@pytest.mark.parametrize("solver", [True, False])
@pytest.mark.parametrize(("dim", "steps"), [(2, 1), (2, 4), (3, 1)])
def test_forward_and_reverse_products_agree(dim, steps, solver):
    warp, mesh = warped(dim, steps=steps)
    rng = np.random.default_rng(1)
    # Copies of nodes, nodes that do not move, coordinates that the solver has twice or not at all.
    pts, conn, sizes, flat = facets(mesh, "BLOCK", "x_m", "y_p")
    warp.setSurfaceDefinition(pts, conn, sizes)
    warp.setExternalMeshIndices(rng.integers(0, mesh.points.size, mesh.points.size))
    moves = np.isin(flat, mesh.marker("BLOCK").nodes)
    warp.setSurfaceCoordinates(np.where(moves[:, None], shaken(pts), pts))
    warp.warpMesh()
    change, weights = rng.normal(size=pts.shape), rng.normal(size=mesh.points.size)
    moved = warp.warpDerivFwd(change, solverVec=solver)
    np.testing.assert_array_equal(warp.warpDerivFwd(change.ravel(), solver), moved)
    warp.warpDeriv(weights, solverVec=solver)
    found = warp.getdXs()
    assert found.shape == pts.shape
    assert (found[~moves] == 0).all()
    assert weights @ moved == pytest.approx((change * found).sum(), rel=1e-11)


@pytest.mark.parametrize("steps", [1, 3])
def test_derivatives_beside_differences(steps):
    warp, mesh = warped(2, steps=steps)
    pts, conn, sizes, _ = facets(mesh, "BLOCK")
    warp.setSurfaceDefinition(pts, conn, sizes)
    at_rest = warp.verifyWarpDeriv(dofEnd=pts.size)
    np.testing.assert_allclose(at_rest[:, 0], at_rest[:, 1], rtol=1e-6, atol=1e-8)
    warp.setSurfaceCoordinates(shaken(pts))
    rows = warp.verifyWarpDeriv(dofStart=2, dofEnd=9)
    assert rows.shape == (7, 2)
    assert np.abs(rows).min() > 1e-3
    np.testing.assert_allclose(rows[:, 0], rows[:, 1], rtol=1e-6)
    weights = np.zeros(mesh.points.size)
    np.testing.assert_array_equal(warp.verifyWarpDeriv(weights), np.zeros((10, 2)))


def test_walls_that_slide_are_part_of_the_surface_and_of_the_result():
    warp, mesh = warped()
    pts, conn, sizes, flat = facets(mesh, "BLOCK", "y_p")
    warp.setSurfaceDefinition(pts, conn, sizes)
    moves = np.isin(flat, mesh.marker("BLOCK").nodes)
    warp.setSurfaceCoordinates(np.where(moves[:, None], shaken(pts, 0.05), pts))
    warp.warpMesh()
    now = warp.getSurfaceCoordinates()
    np.testing.assert_array_equal(now[~moves], warp.getWarpGrid().reshape(-1, 3)[flat[~moves]])
    assert np.abs(now - pts)[~moves].max() > 1e-4
    grid_before = warp.getSolverGrid()
    warp.setSurfaceCoordinates(now)  # what it gave, it takes
    warp.warpMesh()
    np.testing.assert_array_equal(warp.getSolverGrid(), grid_before)
    warp.setSurfaceDefinition(pts, conn, sizes)
    np.testing.assert_allclose(warp.getSurfaceCoordinates(), now, atol=1e-15)


def test_the_grid_is_written(tmp_path):
    warp, _mesh = warped()
    warp.setSurfaceCoordinates(shaken(warp.getSurfaceCoordinates()))
    warp.warpMesh()
    path = tmp_path / "warped.su2"
    warp.writeGrid(path)
    np.testing.assert_array_equal(sv.read(path).points.ravel(), warp.getWarpGrid())
    with pytest.raises(CaseError, match="writeGrid needs the name of a file"):
        warp.writeGrid()


def test_a_cgns_file_is_written_with_all_that_was_in_it(tmp_path):
    path, out = tmp_path / "passage.cgns", tmp_path / "warped.cgns"
    save_passage(path, passage_grid())
    roles = {"BLADE": "moving", "lower": "periodic", "upper": "periodic", "HUB": "sliding"}
    case = Case(roles=roles, periodic="fixed")
    warp = USMesh({"gridFile": str(path), "case": case})
    blade = warp.getSurfaceCoordinates()
    warp.setSurfaceCoordinates(blade + [0.0, 0.02, 0.05] * np.sin(blade[:, :1]))
    warp.warpMesh()
    warp.writeGrid(str(out))
    # The file has the nodes where its two blocks meet in each: so has the grid of IDWarp.
    with h5py.File(out) as file:
        blocks = [
            zone["GridCoordinates"] for zone in file["Base"].values() if "GridC" in str(list(zone))
        ]
        grid_of_file = np.concatenate(
            [np.stack([b[f"Coordinate{c}"][" data"][()].ravel() for c in "XYZ"], 1) for b in blocks]
        )
    assert len(grid_of_file) > len(sv.read(path).points)
    np.testing.assert_array_equal(warp.getWarpGrid(), grid_of_file.ravel())
    np.testing.assert_array_equal(warp.getSolverGrid(), grid_of_file.ravel())
    rng = np.random.default_rng(0)
    indices = rng.permutation(grid_of_file.size)
    warp.setExternalMeshIndices(indices)
    np.testing.assert_array_equal(warp.getSolverGrid(), grid_of_file.ravel()[indices])
    change, weights = rng.normal(size=blade.shape), rng.normal(size=grid_of_file.size)
    for solver in (True, False):
        warp.warpDeriv(weights, solver)
        moved = warp.warpDerivFwd(change, solver)
        assert weights @ moved == pytest.approx((change * warp.getdXs()).sum(), rel=1e-10)


def test_mesh_and_case_may_be_files(tmp_path):
    mesh = grid((6, 6), hole=HOLE[:2])
    sv.write(tmp_path / "mesh.su2", mesh)
    case_of(mesh).change(mesh_file=tmp_path / "mesh.su2").write(tmp_path / "case.cfg")
    files = {"gridFile": str(tmp_path / "mesh.su2"), "case": str(tmp_path / "case.cfg")}
    warp = USMesh(files | {"symmetryPlanes": [], "fileType": "CGNS", "specifiedSurfaces": None})
    np.testing.assert_array_equal(warp.getWarpGrid(), mesh.points.ravel())


# Errors --------------------------------------------------------------------------------------


def test_options_of_idwarp_that_do_nothing_are_named():
    mesh = grid((6, 6), hole=HOLE[:2])
    with pytest.warns(UserWarning, match="options of IDWarp without effect here: aExp, LdefFact;"):
        USMesh({"gridFile": mesh, "case": case_of(mesh), "aExp": 3.0, "LdefFact": 1.0})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"case": None}, "option 'case' is missing"),
        ({"gridFile": None}, "option 'gridFile' is missing"),
        ({"useRotation": True}, "option 'useRotation' is unknown; give gridFile"),
    ],
)
def test_options_must_be_known_and_complete(change, words):
    mesh = grid((6, 6), hole=HOLE[:2])
    with pytest.raises(CaseError, match=words):
        USMesh({"gridFile": mesh, "case": case_of(mesh)} | change)
    with pytest.raises(CaseError, match="'gridFile' is missing; option 'case' is missing"):
        USMesh()


def test_it_works_on_one_process():
    class Comm:
        size = 4

    mesh = grid((6, 6), hole=HOLE[:2])
    with pytest.raises(
        CaseError, match=r"works on one process, and was given 4; give it MPI\.COMM"
    ):
        USMesh({"gridFile": mesh, "case": case_of(mesh)}, comm=Comm())


@pytest.mark.parametrize("wrong", [-1, 98])
def test_indices_of_the_grid_must_exist(wrong):
    mesh = grid((6, 6))
    warp = USMesh({"gridFile": mesh, "case": Case(roles={"x_m": "moving"})})
    assert mesh.points.size == 98
    warp.setExternalMeshIndices([0, 97])
    with pytest.raises(CaseError, match=rf"go from {min(wrong, 0)} to .* has 98 coord"):
        warp.setExternalMeshIndices([0, wrong])


def test_vectors_must_be_as_long_as_the_grid():
    warp, mesh = warped()
    with pytest.raises(
        CaseError, match=rf"has 5 numbers; expected {mesh.points.size}, the number that getS"
    ):
        warp.warpDeriv(np.ones(5))


def test_the_surface_must_be_that_of_the_mesh_and_whole():
    warp, mesh = warped()
    pts, *_ = facets(mesh, "BLOCK")
    other = pts.copy()
    other[4, 0] += 0.01
    with pytest.raises(CaseError, match=r"node 4 of the surface, at .* is 0\.01 from the next"):
        warp.setSurfaceDefinition(other)
    with pytest.raises(CaseError, match=r"of 26 moving nodes of the case are not in the surface"):
        warp.setSurfaceDefinition(pts[:8])


def test_coordinates_must_be_as_many_and_agree_and_leave_what_is_held():
    warp, mesh = warped()
    pts, conn, sizes, flat = facets(mesh, "BLOCK", "x_m", "y_p")
    warp.setSurfaceDefinition(pts, conn, sizes)
    with pytest.raises(CaseError, match=f"3 nodes were given for a surface of {len(pts)}"):
        warp.setSurfaceCoordinates(pts[:3])
    apart = pts.copy()
    apart[5] += 1e-3
    with pytest.raises(CaseError, match="node 5 of the surface is there several times"):
        warp.setSurfaceCoordinates(apart)
    for name in ("x_m", "y_p"):
        held = np.flatnonzero(np.isin(flat, mesh.marker(name).nodes))[0]
        pulled = pts.copy()
        pulled[held] += 1e-3
        with pytest.raises(
            CaseError, match=f"node {held} of .* was moved by 0.00173.* the role mov"
        ):
            warp.setSurfaceCoordinates(pulled)
    with pytest.raises(CaseError, match="values of the surface are not finite"):
        warp.setSurfaceCoordinates(np.full_like(pts, np.nan))
    warp.warpMesh()
    np.testing.assert_array_equal(warp.getSolverGrid(), mesh.points.ravel())
