"""Walls: columns of layers at boundaries, and their numbers."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.mesh.walls import VALUES, find_columns, measure_walls
from tests.builders import (
    airfoil,
    cube,
    grid,
    halo_text,
    layered,
    layered_cylinder,
    passage,
    shuffled,
    sphere_in_box,
    square,
)
from tests.formats.su2_samples import save
from tests.oracles import walls as oracle

KINDS = [(f, kind) for f in (square, cube) for kind in ("plain", "simplex")]
KINDS += [(cube, "prism"), (cube, "mixed"), (square, "mixed")]


def bent(mesh):
    """The mesh with points moved, so that no two heights are equal."""
    wave = np.sin(7 * mesh.points @ np.linspace(1, 2, mesh.dim**2).reshape(mesh.dim, -1))
    return mesh.with_points(mesh.points + 0.02 * wave)


def as_rows(columns, points, marker):
    """The columns of a boundary as the oracle has them, sorted."""
    values, count = measure_walls(columns, points), len(columns.nodes)
    rows = []
    for at in columns.places(marker):
        nodes = tuple(n for n in columns.nodes[at].tolist() if n >= 0) if at < count else ()
        rows.append(oracle.Column(nodes, *(float(values[name][at]) for name in VALUES)))
    return sorted(rows, key=lambda column: (column.nodes, column.height))


def check(mesh, points=None, skip=()):
    columns = find_columns(mesh)
    moved = mesh if points is None else mesh.with_points(points)
    for marker in mesh.marker_names:
        rows, literal = as_rows(columns, moved.points, marker), oracle.columns(moved, marker, skip)
        assert [row.nodes for row in rows] == [row.nodes for row in literal], marker
        np.testing.assert_allclose(
            [row[1:] for row in rows], [row[1:] for row in literal], rtol=1e-9, atol=1e-5
        )


@pytest.mark.parametrize(("build", "kind"), KINDS)
def test_columns_and_numbers_of_all_types(build, kind):
    check(shuffled(bent(build(6, kind)), 3)[1])


@pytest.mark.parametrize("mesh", [airfoil(16), sphere_in_box(), layered_cylinder(4, 12, 0.01)])
def test_numbers_of_curved_walls(mesh):
    check(bent(mesh))


@pytest.mark.parametrize(
    "mesh",
    [airfoil(16), sphere_in_box(), layered_cylinder(4, 12, 0.01), bent(cube(6, "mixed"))],
    ids=["airfoil", "sphere", "cylinder", "mixed"],
)
def test_numbers_do_not_depend_on_which_boundaries_are_measured(mesh):
    moved = bent(mesh)
    every = sv.walls(moved, mesh)
    names = mesh.marker_names
    for some in (*((name,) for name in names), names[1:]):
        found = sv.walls(moved, mesh, some)
        assert found.summary() == every.of(some).summary()
        assert found.layered == every.layered & set(some)
        for number in found.values:
            np.testing.assert_array_equal(found.at_cells(number), every.of(some).at_cells(number))


def test_boundaries_that_were_not_measured_are_not_reported():
    mesh = grid((4, 4))
    with pytest.raises(MeshError, match="y_p were not measured, only those at y_m"):
        sv.walls(mesh, markers=["y_m"]).of(["y_p"])


def test_channel_by_hand():
    y = np.array([0, 0.1, 0.2005, 0.35, 0.55, 0.8, 1.0])
    mesh = grid((4, 6), place=lambda p: np.stack([p[:, 0], y[p[:, 1].astype(int)]], axis=1))
    lower, upper = (sv.walls(mesh).summary()[name] for name in ("y_m", "y_p"))
    assert lower["layered"]
    assert lower["equal_layers"]["after"]["min"] == 2
    assert lower["first_height"]["after"]["max"] == pytest.approx(0.1)
    assert lower["growth"]["after"]["mean"] == pytest.approx(0.1495 / 0.1005)
    assert lower["angle"]["after"]["min"] == pytest.approx(90)
    assert upper["equal_layers"]["after"]["max"] == 1
    assert upper["growth"]["after"]["max"] == pytest.approx(0.1495 / 0.1005)


def test_changes_of_a_sheared_layer():
    y = np.array([0, 0.1, 0.2, 0.35, 0.55, 0.8, 1.0])
    mesh = grid((6, 6), place=lambda p: np.stack([p[:, 0] / 6, y[p[:, 1].astype(int)]], axis=1))
    points = mesh.points.copy()
    points[points[:, 1] == 0.1] += [0.05, -0.05]
    walls = sv.walls(mesh.with_points(points), mesh)
    low = walls.summary()["y_m"]
    for value, expected in ((low["first_height"]["ratio"], 0.5), (low["angle"]["change"], 45.0)):
        assert (value["min"], value["max"]) == pytest.approx((expected, expected))
    assert low["first_height"]["before"]["mean"] == pytest.approx(0.1)
    assert low["first_height"]["after"]["mean"] == pytest.approx(0.05)
    inner = np.isnan(walls.at_cells("height_ratio"))
    assert np.count_nonzero(inner) == 16
    below = (mesh.points[mesh.cells.by_type[9][1], 1].max(axis=1) == 0.1) & ~inner
    assert np.allclose(walls.at_cells("angle_change")[below], 45)


def test_worst_of_a_cell_counts_and_folded_heights_are_worse_than_any():
    mesh = grid((3, 3))
    points = mesh.points.copy()
    (inner,) = np.flatnonzero((np.abs(points * 3 - 1) < 1e-9).all(axis=1))
    points[inner] = [1 / 3, -0.1]
    walls = sv.walls(mesh.with_points(points), mesh)
    cell = mesh.cells.by_type[9][1][:, 0].argmin()
    assert walls.at_cells("height_ratio")[cell] == pytest.approx(-0.3)
    assert walls.at_cells("first_height")[cell] == pytest.approx(-0.1)
    assert walls.at_cells("first_height", before=True)[cell] == pytest.approx(1 / 3)


def test_sharp_trailing_edge_of_an_o_mesh_has_one_column():
    mesh = airfoil(16)
    columns = find_columns(mesh)
    edge = mesh.marker("airfoil").nodes[np.argmax(mesh.points[mesh.marker("airfoil").nodes, 0])]
    (at,) = np.flatnonzero(columns.nodes[:, 0] == edge)
    assert measure_walls(columns, mesh.points)["wall_angle"][at] == pytest.approx(90)


def c_mesh(n=4, layers=3):
    """Wake cut: body's upper and lower side end in one node, cells of both sides meet behind it."""
    x = np.r_[np.arange(n, -1, -1.0), np.arange(-1, -n - 1, -1.0)]
    cut = np.stack([x, np.zeros(2 * n + 1)], 1)
    rows = [cut + np.array([0, 0.1 * k]) for k in range(layers + 1)]
    rows += [cut - np.array([0, 0.1 * k]) for k in range(1, layers + 1)]
    points = np.concatenate(rows)
    width = 2 * n + 1
    at = np.arange(len(points)).reshape(-1, width)
    low = at[[0, *range(layers + 1, 2 * layers + 1)]].copy()
    twin = len(points) + np.arange(n)  # upstream of the edge the body's lower side
    low[0, n + 1 :] = twin
    points = np.concatenate([points, points[at[0, n + 1 :]] - [0, 0.01]])
    cells = []
    for table in (at[: layers + 1], low):
        a, b, c, d = table[:-1, :-1], table[:-1, 1:], table[1:, 1:], table[1:, :-1]
        cells.append(np.stack([a, b, c, d], -1).reshape(-1, 4))
    body = np.concatenate([np.stack([t[0, n:-1], t[0, n + 1 :]], 1) for t in (at, low)])
    marker = sv.Marker("body", sv.Cells.from_blocks([(3, body)]))
    return sv.Mesh(points, sv.Cells.from_blocks([(9, np.concatenate(cells))]), (marker,)), at[0, n]


def test_sharp_trailing_edge_of_a_c_mesh_has_a_column_on_each_side():
    mesh, edge = c_mesh()
    check(mesh)
    columns = find_columns(mesh)
    places = np.flatnonzero(columns.nodes[:, 0] == edge)
    assert len(places) == 2
    heights = measure_walls(columns, mesh.points)["first_height"][places]
    np.testing.assert_allclose(heights, 0.1, rtol=0.01)


@pytest.mark.parametrize(("build", "sides"), [
    (lambda: grid((6, 6), [(2, 4), (2, 4)]), ("y_m", "y_p")),
    (lambda: passage((3, 6, 6)), ("per1", "per2")),
])  # fmt: skip
def test_a_halo_is_no_part_of_the_layers(build, sides, tmp_path):
    mesh = build()
    shift = np.zeros((3, 3))
    if mesh.dim == 2:
        shift[2, 1] = -1
    else:
        shift[1, 2] = -np.radians(30)
    halo = sv.read(save(tmp_path, halo_text(mesh, *sides, shift)))
    assert halo.halo is not None
    for marker in mesh.marker_names:
        if marker in halo.marker_names:
            plain, haloed = (sv.walls(m).summary()[marker] for m in (mesh, halo))
            assert plain == haloed
    check(halo, skip=set(np.flatnonzero(halo.halo.cells).tolist()))


def test_stack_ends_where_cells_are_no_longer_flat():
    mesh = layered(8, 0.001)
    y = np.unique(mesh.points[:, 1])
    flat = np.diff(y) < 1 / 24
    expected = y[np.argmin(flat)]
    columns = find_columns(mesh, 20)
    at = columns.boundary.marker == columns.boundary.names.index("y_m")
    np.testing.assert_allclose(columns.stack_thickness(mesh.points)[at], expected)
    assert sv.walls(mesh).layered == {"y_m"}


def test_stack_of_prisms_uses_the_square_root_of_the_area():
    n, z = 3, np.array([0, 0.05, 0.2, 0.5, 1.0])

    def place(p):
        return np.c_[p[:, :2] / n, z[p[:, 2].astype(int)]]

    mesh = grid((n, n, 4), kind="prism", place=place)
    columns = find_columns(mesh, 20)
    at = columns.boundary.marker == columns.boundary.names.index("z_m")
    np.testing.assert_allclose(columns.stack_thickness(mesh.points)[at], 0.2)


def test_a_mesh_of_tetrahedra_has_first_heights_only():
    mesh = cube(4, "simplex")
    walls = sv.walls(bent(mesh), mesh, ["BLOCK"])
    block = walls.summary()["BLOCK"]
    assert list(walls.summary()) == ["BLOCK"]
    assert not block["layered"]
    assert block["first_height"]["before"]["min"] > 0
    assert block["first_height"]["ratio"]["min"] < 1 < block["first_height"]["ratio"]["max"]
    assert block["growth"]["after"] == {"min": None, "mean": None, "max": None}


def test_mistakes():
    mesh = square()
    with pytest.raises(MeshError, match="no marker 'wall'"):
        sv.walls(mesh, markers=["wall"])
    with pytest.raises(MeshError, match="cannot be the reference"):
        sv.walls(mesh, cube())


@pytest.mark.parametrize("layers", [5, 9, 14])
def test_growth_is_that_through_the_whole_stack_and_to_the_first_cell_beyond(layers):
    """A jump is seen in the stack, and at its end, but not behind it."""
    flat = np.full(12, 0.01)
    flat[layers:] = 0.03
    beyond = [0.1, 0.5, 0.1]
    y = np.concatenate([[0.0], np.cumsum([*flat, *beyond])])
    mesh = grid(
        (4, len(y) - 1),
        place=lambda p: np.c_[p[:, 0] * 0.1, np.interp(p[:, 1], np.arange(len(y)), y)],
    )
    growth = sv.walls(mesh, markers=["y_m"]).summary()["y_m"]["growth"]["after"]
    expected = max(3.0, 0.1 / flat[-1]) if layers < 12 else 10.0
    assert growth["min"] == growth["max"] == pytest.approx(expected)
    moved = mesh.points.copy()
    within = (y[8] - 1e-9 < moved[:, 1]) & (moved[:, 1] < y[8] + 1e-9)
    moved[within, 1] -= 0.9 * (y[8] - y[7])
    walls = sv.walls(mesh.with_points(moved), mesh, ["y_m"]).summary()["y_m"]["growth"]
    assert walls["before"]["max"] == pytest.approx(expected)
    assert walls["after"]["max"] > 12.0
