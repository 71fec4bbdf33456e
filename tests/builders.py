"""Small meshes for tests, whose nodes, sides and names follow from index arithmetic alone.

A mesh is made from cells in a parameter space (a grid), from rules that name each side there,
and from a map to physical space. So a test can tell what every node is without the code under
test.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.periodic import Pair, match
from slideviz.mesh.zones import join_zones

SIDE_TYPE = {2: {2: 3}, 3: {3: 5, 4: 9}}
"""VTK identifier of a side by dimension of the mesh and number of nodes."""

KUHN = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
"""A hexahedron as six tetrahedra around its diagonal; neighbours of a grid conform."""

Rule = tuple[str, Callable[[np.ndarray], bool]]


def box_rules(shape: Sequence[int]) -> list[Rule]:
    """Name the sides of a grid x_m, x_p, y_m, ..., and everything else BLOCK."""
    rules: list[Rule] = []
    for axis, size in enumerate(shape):
        for letter, end in (("m", 0), ("p", size)):
            rules.append(
                (f"{'xyz'[axis]}_{letter}", lambda p, a=axis, e=end: bool(np.all(p[:, a] == e)))
            )
    return [*rules, ("BLOCK", lambda p: True)]


def make_mesh(
    points: np.ndarray,
    blocks: Sequence[tuple[int, np.ndarray]],
    rules: Sequence[Rule],
    params: np.ndarray | None = None,
    name: str = "test mesh",
) -> Mesh:
    """Mesh of the cells; sides of one cell only get the name of the first rule they obey.

    Nodes that no cell uses are removed. A rule sees the parameters (k, p) of a side's nodes; a
    side that obeys no rule belongs to no marker.
    """
    params = points if params is None else params
    seen: dict[tuple[int, ...], list[tuple[int, ...]]] = defaultdict(list)
    for vtk, table in blocks:
        for nodes in np.asarray(table):
            for local in ELEMENTS[vtk].facets:
                side = tuple(int(nodes[k]) for k in local)
                seen[tuple(sorted(side))].append(side)
    found: dict[str, list[tuple[int, ...]]] = {rule[0]: [] for rule in rules}
    for sides in seen.values():
        if len(sides) == 1:
            at = params[list(sides[0])]
            named = next((n for n, obeys in rules if obeys(at)), None)
            if named is not None:
                found[named].append(sides[0])
    used = np.unique(np.concatenate([np.ravel(t) for _, t in blocks]))
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    dim = points.shape[1]
    markers = []
    for label, sides in found.items():
        if sides:
            by_size = defaultdict(list)
            for side in sides:
                by_size[SIDE_TYPE[dim][len(side)]].append([new[k] for k in side])
            markers.append(Marker(label, Cells.from_blocks(by_size.items())))
    cells = Cells.from_blocks([(vtk, new[np.asarray(t)]) for vtk, t in blocks])
    return Mesh(points[used], cells, tuple(markers), name=name)


def grid(
    shape: Sequence[int],
    hole: Sequence[tuple[int, int]] | None = None,
    kind: str = "plain",
    place: Callable[[np.ndarray], np.ndarray] | None = None,
    rules: Sequence[Rule] | None = None,
    wrap: int | None = None,
) -> Mesh:
    """Structured mesh of ``shape`` cells, without the cells of ``hole``.

    ``kind``: plain (quadrilaterals, hexahedra), simplex (triangles, tetrahedra), prism, mixed.
    ``place`` maps indices (n, d) to points; default is the unit box. ``wrap`` joins the last
    layer of that axis to the first (an annulus).
    """
    dim = len(shape)
    sizes = [s if a == wrap else s + 1 for a, s in enumerate(shape)]
    index = np.stack(np.meshgrid(*[np.arange(s) for s in sizes], indexing="ij"), -1)
    index = index.reshape(-1, dim)
    number = np.arange(len(index)).reshape(sizes)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    if dim == 3:
        corners = [(*c, k) for k in (0, 1) for c in corners]
    cells, where = [], []
    for cell in np.ndindex(*shape):
        inside = hole and all(lo <= c < hi for c, (lo, hi) in zip(cell, hole, strict=True))
        if inside:
            continue
        at = [
            tuple((c + s) % m for c, s, m in zip(cell, step, sizes, strict=True))
            for step in corners
        ]
        cells.append([number[a] for a in at])
        where.append(cell)
    cells, where = np.array(cells), np.array(where)
    extra, blocks = _split(cells, where, kind, dim, len(index))
    params = np.concatenate([index.astype(float), *[index[c].mean(0)[None] for c in extra]])
    mapped = place or (lambda p: p / np.array(shape, float))
    return make_mesh(mapped(params), blocks, rules or box_rules(shape), params, f"{kind} {dim}D")


def _split(cells, where, kind, dim, count):
    """Cells with middle nodes, and blocks of element types."""
    if kind == "plain":
        return [], [(9 if dim == 2 else 12, cells)]
    if dim == 2:
        cut = np.ones(len(cells), bool) if kind == "simplex" else where.sum(axis=1) % 2 == 0
        triangles = np.concatenate([cells[cut][:, [0, 1, 2]], cells[cut][:, [0, 2, 3]]])
        return [], [(t, c) for t, c in ((5, triangles), (9, cells[~cut])) if len(c)]
    if kind == "simplex":
        return [], [(10, np.concatenate([cells[:, list(t)] for t in KUHN]))]
    part = np.ones(len(cells), int) if kind == "prism" else where[:, 0] % 3
    prisms = cells[part == 1]
    blocks = [(12, cells[part == 0])]
    blocks.append(
        (13, np.concatenate([prisms[:, [0, 1, 2, 4, 5, 6]], prisms[:, [0, 2, 3, 4, 6, 7]]]))
    )
    split = cells[part == 2]
    pyramids = [
        [cell[k] for k in reversed(side)] + [count + i]
        for i, cell in enumerate(split)
        for side in ELEMENTS[12].facets
    ]
    if pyramids:
        blocks.append((14, np.array(pyramids)))
    return list(split), [(t, c) for t, c in blocks if len(c)]


def square(n: int = 10, kind: str = "plain", block: bool = True) -> Mesh:
    """Unit square of n cells a side with a block of 2 x 2 cells (n even) in the middle."""
    h = n // 2
    return grid((n, n), [(h - 1, h + 1)] * 2 if block else None, kind)


def cube(n: int = 6, kind: str = "plain", block: bool = True) -> Mesh:
    """Unit cube of n cells a side with a block of 2 x 2 x 2 cells in the middle."""
    h = n // 2
    return grid((n, n, n), [(h - 1, h + 1)] * 3 if block else None, kind)


def ring(shape, low=0.5, high=1.0, angle_deg=30.0, start_deg=0.0):
    """Map of indices to (r, theta[, z]), as Cartesian points about z."""

    def place(p: np.ndarray) -> np.ndarray:
        r = low + (high - low) * p[:, 0] / shape[0]
        t = np.radians(start_deg + angle_deg * p[:, 1] / shape[1])
        columns = [r * np.cos(t), r * np.sin(t)]
        if p.shape[1] == 3:
            columns.append(p[:, 2] / shape[2])
        return np.stack(columns, axis=1)

    return place


def sector(n: int = 8, angle_deg: float = 30.0, low: float = 0.5, start_deg: float = 0.0) -> Mesh:
    """2D sector: inner, outer, per1, per2, and a block of 2 x 2 cells."""
    shape, h = (n, n), n // 2
    return grid(
        shape,
        [(h - 1, h + 1)] * 2,
        place=ring(shape, low, 1.0, angle_deg, start_deg),
        rules=_renamed(shape, ("inner", "outer", "per1", "per2")),
    )


def passage(
    shape=(4, 6, 8), angle_deg: float = 30.0, kind: str = "plain", blade: bool = True
) -> Mesh:
    """Annular sector with hub, shroud, per1, per2, inflow, outflow and a blade between them."""
    j, k = shape[1] // 2, shape[2] // 2
    return grid(
        shape,
        [(0, shape[0]), (j - 1, j + 1), (k - 1, k + 1)] if blade else None,
        kind,
        place=ring(shape, angle_deg=angle_deg),
        rules=[
            *_renamed(shape, ("hub", "shroud", "per1", "per2", "inflow", "outflow"))[:-1],
            ("blade", lambda p: True),
        ],
    )


def cut_blade(shape=(4, 6, 8), angle_deg: float = 30.0) -> Mesh:
    """Annular sector between two blades: the periodic sides per1, per2 go on where these end."""
    first, last = 2, shape[2] - 2
    around = ring(shape, angle_deg=angle_deg)

    def place(p: np.ndarray) -> np.ndarray:
        along = np.clip((p[:, 2] - first) / (last - first), 0.0, 1.0)
        thick = 0.8 * along * (1.0 - along) * (1.0 - 2.0 * p[:, 1] / shape[1])
        return around(np.column_stack([p[:, 0], p[:, 1] + thick, p[:, 2]]))

    def on_blade(p: np.ndarray) -> bool:
        return bool(np.ptp(p[:, 1]) == 0.0 and p[:, 2].min() >= first and p[:, 2].max() <= last)

    names = ("hub", "shroud", "per1", "per2", "inflow", "outflow")
    hub, shroud, *others = _renamed(shape, names)[:-1]
    return grid(shape, place=place, rules=[hub, shroud, ("blade", on_blade), *others])


def stage(angles=(40.0, 30.0), lengths=(1.0, 0.75)) -> Mesh:
    """Passages of two rows of blades as the zones of one mesh, the second behind the first."""
    front, behind = (passage((4, 6, 8), angle) for angle in angles)
    low, high = (0.0, lengths[0]), (lengths[0], lengths[0] + lengths[1])
    zones = [
        mesh.with_points(mesh.points * [1.0, 1.0, end - start] + [0.0, 0.0, start])
        for mesh, (start, end) in ((front, low), (behind, high))
    ]
    return join_zones([replace(zone, zone=k, zones=2) for k, zone in enumerate(zones, 1)])


def zones_in_a_row(count: int, shape: Sequence[int], bend: float = 0.0) -> Mesh:
    """Unit squares or cubes of ``shape`` cells, side by side along x, as the zones of one mesh.

    What is x_p of one is x_m of the next. ``bend``: depth of the waves in these interfaces.
    """

    def zone(k: int) -> Mesh:
        def place(p: np.ndarray) -> np.ndarray:
            at = p / np.array(shape, float)
            return at + [[k, *[0.0] * (len(shape) - 1)]] + bend * np.sin(np.pi * at[:, ::-1])

        return replace(grid(shape, place=place), zone=k + 1, zones=count)

    return join_zones([zone(k) for k in range(count)])


def nested_zones() -> Mesh:
    """Unit square of three zones: a frame, a frame in it, and a square in that.

    The boundaries of each are outer and inner.
    """

    def zone(k: int) -> Mesh:
        n = 10 - 4 * (k - 1)
        rules = [("outer", lambda p: bool((p[:, 0] % n == 0).all() or (p[:, 1] % n == 0).all()))]
        mesh = grid(
            (n, n),
            [(2, n - 2)] * 2 if k < 3 else None,
            place=lambda p: (p + 2.0 * (k - 1)) / 10.0,
            rules=[*rules, ("inner", lambda p: True)],
        )
        return replace(mesh, zone=k, zones=3)

    return join_zones([zone(k) for k in (1, 2, 3)])


def _renamed(shape, names) -> list[Rule]:
    rules = box_rules(shape)
    return [*((n, r[1]) for n, r in zip(names, rules, strict=False)), rules[-1]]


def annulus(n: int = 24, layers: int = 5, far_parts: int = 1) -> Mesh:
    """Full ring: ``wall`` at r = 0.5, and the far field at r = 2 as ``far0``, ``far1``, ..."""
    shape = (layers, n)

    def part(p: np.ndarray, k: int) -> bool:
        if not np.all(p[:, 0] == layers):
            return False
        first = p[:, 1].min() if np.ptp(p[:, 1]) == 1 else p[:, 1].max()
        return int(first * far_parts // n) == k

    rules: list[Rule] = [("wall", lambda p: bool(np.all(p[:, 0] == 0)))]
    rules += [(f"far{k}", lambda p, k=k: part(p, k)) for k in range(far_parts)]
    return grid(shape, place=ring(shape, 0.5, 2.0, 360.0), rules=rules, wrap=1)


def airfoil(n: int = 40, layers: int = 8, first: float = 0.05) -> Mesh:
    """O-grid around a symmetric profile with a sharp trailing edge, one closed marker."""
    shape = (layers, n)

    def place(p: np.ndarray) -> np.ndarray:
        t = 2 * np.pi * p[:, 1] / n
        x = 0.5 * (1 + np.cos(t))
        half = 0.6 * (
            0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
        )
        profile = np.stack([x, half * np.sign(np.sin(t)) * (np.abs(np.sin(t)) > 1e-9)], axis=1)
        far = np.array([0.5, 0.0]) + 3 * np.stack([np.cos(t), np.sin(t)], axis=1)
        s = p[:, 0] / layers
        s = (first * s + (1 - first) * s**2)[:, None]
        return (1 - s) * profile + s * far

    return grid(
        shape,
        place=place,
        rules=[("airfoil", lambda p: bool(np.all(p[:, 0] == 0))), ("far", lambda p: True)],
        wrap=1,
    )


def far_field(size: float = 60.0, bodies: int = 1, n: int = 4) -> Mesh:
    """Block of side 1 (``body``) in a square field of half-width ``size`` (``far``), in 2D.

    With two ``bodies`` a block 2 long and 1 high (``other``) begins 2.5 behind it. Cells grow
    outwards.
    """
    near = np.linspace(-0.5, 0.5, n + 1)
    out = np.geomspace(0.5, size, 2 * n + 1)[1:]
    behind = np.r_[np.linspace(0.5, 3.0, n + 1)[1:], np.linspace(3.0, 5.0, n + 1)[1:]]
    x = np.r_[-out[::-1], near, *([behind] if bodies > 1 else []), (bodies > 1) * 4.5 + out]
    y = np.r_[-out[::-1], near, out]
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    at = np.arange(len(points)).reshape(len(x), len(y))
    cells = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], -1).reshape(-1, 4)

    def on(p: np.ndarray, first: float, last: float) -> bool:
        return bool(np.all((first <= p[..., 0]) & (p[..., 0] <= last) & (abs(p[..., 1]) <= 0.5)))

    solid = np.array([on(points[c], -0.5, 0.5) or on(points[c], 3.0, 5.0) for c in cells])
    solid &= (points[cells].mean(axis=1)[:, 0] < 1) | (bodies > 1)
    rules: list[Rule] = [("body", lambda p: on(p, -0.5, 0.5))]
    rules += [("other", lambda p: on(p, 3.0, 5.0))] if bodies > 1 else []
    return make_mesh(points, [(9, cells[~solid])], [*rules, ("far", lambda p: True)])


def sphere_in_box(n: int = 4, layers: int = 3) -> Mesh:
    """Hexahedra between a sphere of radius 0.4 (``sphere``) and a cube of side 2 (six sides)."""
    lattice = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    outer = lattice[np.any((lattice == 0) | (lattice == n), axis=1)]
    number = {tuple(p): i for i, p in enumerate(outer)}
    quads = []
    for axis in range(3):
        for end in (0, n):
            for a, b in np.ndindex(n, n):
                ring_ = [(a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)]
                quads.append([number[tuple(np.insert(q, axis, end))] for q in ring_])
    quads = np.array(quads)
    on_cube = 2 * outer / n - 1.0
    normal = on_cube / np.linalg.norm(on_cube, axis=1)[:, None]
    count = len(outer)
    s = np.linspace(0, 1, layers + 1)
    points = np.concatenate([(1 - t) * 0.4 * normal + t * on_cube for t in s])
    cells = np.concatenate(
        [np.hstack([quads + k * count, quads + (k + 1) * count]) for k in range(layers)]
    )
    # A hexahedron whose base looks away from its top is turned.
    for cell in cells:
        a, b, d, e = points[cell[[0, 1, 3, 4]]]
        if np.dot(np.cross(b - a, d - a), e - a) < 0:
            cell[:] = cell[[0, 3, 2, 1, 4, 7, 6, 5]]
    rules: list[Rule] = [
        (f"{'xyz'[a]}_{w}", lambda p, a=a, e=e: bool(np.allclose(p[:, a], e)))
        for a in range(3)
        for w, e in (("m", -1.0), ("p", 1.0))
    ]
    return make_mesh(points, [(12, cells)], [*rules, ("sphere", lambda p: True)])


def plate(n: int = 8) -> Mesh:
    """Square with a thin plate: a slit whose two faces are markers with nodes of their own.

    The tips are shared. Slit: y = 1/2, x from 1/4 to 3/4 (n a multiple of 4).
    """
    base = square(n, block=False)
    x, y = (base.points * n).round().astype(int).T
    slit = np.flatnonzero((y == n // 2) & (x > n // 4) & (x < 3 * n // 4))
    twin = np.full(len(base.points), -1)
    twin[slit] = len(base.points) + np.arange(len(slit))
    cells = np.array(base.cells.by_type[9][1])
    above = base.points[cells].mean(axis=1)[:, 1] > 0.5
    cells[above] = np.where(twin[cells[above]] >= 0, twin[cells[above]], cells[above])
    points = np.concatenate([base.points, base.points[slit]])
    row = np.flatnonzero((y == n // 2) & (x >= n // 4) & (x <= 3 * n // 4))
    row = row[np.argsort(x[row])]
    top = np.where(twin[row] >= 0, twin[row], row)
    slits = [
        Marker(label, Cells.from_blocks([(3, np.stack([line[:-1], line[1:]], axis=1))]))
        for label, line in (("below", row), ("above", top))
    ]
    return Mesh(points, Cells.from_blocks([(9, cells)]), (*base.markers, *slits), name="plate")


def layered(n: int = 12, first: float = 1e-6) -> Mesh:
    """Square whose cells shrink geometrically to ``first`` at y = 0 (a boundary layer)."""
    ratio = (1.0 / first) ** (1.0 / (n - 1))
    heights = first * ratio ** np.arange(n)
    y = np.r_[0.0, np.cumsum(heights)]

    def place(p: np.ndarray) -> np.ndarray:
        return np.stack([p[:, 0] / n, y[p[:, 1].astype(int)] / y[-1]], axis=1)

    return grid((n, n), place=place)


def layered_cylinder(layers: int = 10, n: int = 24, first: float = 1e-6) -> Mesh:
    """Layers around ``wall``, a cylinder between ``hub`` and ``shroud``; the first is ``first``."""
    growth = (1.0 / first) ** (1.0 / (layers - 1))
    r = 1.0 + np.r_[0.0, np.cumsum(first * growth ** np.arange(layers))]

    def place(p: np.ndarray) -> np.ndarray:
        at, angle = r[p[:, 0].astype(int)], 2.0 * np.pi * p[:, 1] / n
        return np.stack([at * np.cos(angle), at * np.sin(angle), p[:, 2] / 2.0], axis=1)

    rules: list[Rule] = [
        (name, lambda p, axis=axis, end=end: bool(np.all(p[:, axis] == end)))
        for name, axis, end in (("wall", 0, 0), ("far", 0, layers), ("hub", 2, 0), ("shroud", 2, 2))
    ]
    return grid((layers, n, 2), place=place, rules=rules, wrap=1)


def permuted(mesh: Mesh, order: np.ndarray) -> Mesh:
    """The same mesh with node ``order[i]`` of the old one as node i."""
    new = np.empty(len(order), np.int64)
    new[order] = np.arange(len(order))
    markers = tuple(
        Marker(m.name, Cells.from_types(m.cells.types, new[m.cells.connectivity]))
        for m in mesh.markers
    )
    cells = Cells.from_types(mesh.cells.types, new[mesh.cells.connectivity])
    return Mesh(mesh.points[order], cells, markers, name=mesh.name)


def shuffled(mesh: Mesh, seed: int) -> tuple[np.ndarray, Mesh]:
    """The order of the old nodes, and the same mesh with nodes and cells in another order."""
    rng = np.random.default_rng(seed)

    def mixed(cells: Cells) -> Cells:
        order = rng.permutation(len(cells))
        rows = np.split(cells.connectivity, cells.offsets[1:-1])
        return Cells.from_types(cells.types[order], np.concatenate([rows[i] for i in order]))

    markers = tuple(Marker(m.name, mixed(m.cells)) for m in mesh.markers)
    order = rng.permutation(len(mesh.points))
    return order, permuted(Mesh(mesh.points, mixed(mesh.cells), markers, name=mesh.name), order)


def pair(kind, dim, vector=(0, 0, 0), angle=0.0, axis=(0.0, 0.0, 1.0), origin=(0.0, 0.0, 0.0)):
    """A periodic pair without nodes."""
    shift = np.array(vector, float)[:dim]
    return Pair("a", "b", kind, shift, angle, axis, origin, np.empty((0, 2), np.int64), 0.0)


def wedge(n: int = 6, angle_deg: float = 60.0) -> Mesh:
    """2D sector down to its axis, where triangles meet in one node; per1, per2, outer, BLOCK."""
    shape = (n, n)
    index = np.array([(0, 0)] + [(i, j) for i in range(1, n + 1) for j in range(n + 1)], float)
    row = {tuple(p): k for k, p in enumerate(index.astype(int).tolist())}
    quads, triangles = [], []
    for i, j in np.ndindex(n, n):
        if i == 0:
            triangles.append([0, row[1, j], row[1, j + 1]])
        elif not (n // 2 - 1 <= i < n // 2 + 1 and n // 2 - 1 <= j < n // 2 + 1):
            quads.append([row[i, j], row[i + 1, j], row[i + 1, j + 1], row[i, j + 1]])

    def on_side(p: np.ndarray, side: int) -> bool:
        return bool(np.all((p[:, 1] == side) | (p[:, 0] == 0)))

    rules: list[Rule] = [
        ("outer", lambda p: bool(np.all(p[:, 0] == n))),
        ("per1", lambda p: on_side(p, 0)),
        ("per2", lambda p: on_side(p, n)),
        ("BLOCK", lambda p: True),
    ]
    points = ring(shape, 0.0, 1.0, angle_deg)(index)
    return make_mesh(points, [(5, np.array(triangles)), (9, np.array(quads))], rules, index)


def channel(n: int = 10) -> Mesh:
    """Box 2 x 1 whose lower wall is in three parts; the middle one can move into the domain."""
    rules = box_rules((2 * n, n))
    rules[2] = ("low1", lambda p: bool(np.all(p[:, 1] == 0) and p[:, 0].max() <= n // 2))
    rules.insert(3, ("bump", lambda p: bool(np.all(p[:, 1] == 0) and p[:, 0].max() <= 3 * n // 2)))
    rules.insert(4, ("low2", lambda p: bool(np.all(p[:, 1] == 0))))
    return grid((2 * n, n), rules=rules, place=lambda p: p / n)


def halo_text(mesh: Mesh, low: str, high: str, transform: np.ndarray) -> str:
    """SU2 file of a mesh whose cells at ``low`` are repeated beyond ``high``, as SU2 had it.

    ``transform`` (3, 3) is centre, angles in radians and translation from ``high`` to ``low``, by
    which all of the layer is found beyond ``high`` again. The nodes of ``low`` receive, too.
    """
    image = match(mesh, low, high)
    partner = dict(image.nodes.tolist())
    layer: list[tuple[int, np.ndarray]] = []
    copy = dict(partner)
    for vtk, (_, table) in mesh.cells.by_type.items():
        for nodes in table[np.isin(table, list(partner)).any(axis=1)]:
            layer.append((vtk, nodes))
            for node in nodes.tolist():
                copy.setdefault(node, len(mesh.points) + len(copy) - len(partner))
    beyond = sorted(set(copy) - set(partner), key=copy.__getitem__)
    centre, (*_, angle), shift = transform
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0]])
    turn = np.vstack([turn, [0, 0, 1]])[: mesh.dim, : mesh.dim]  # from low to high
    moved = (mesh.points[beyond] - (centre + shift)[: mesh.dim]) @ turn.T + centre[: mesh.dim]
    cells = _joined(mesh.cells, [(vtk, [copy[n] for n in nodes.tolist()]) for vtk, nodes in layer])
    sets = [set(nodes.tolist()) for _, nodes in layer]
    markers = []
    for marker in mesh.markers:
        more = [
            (vtk, [copy[n] for n in row])
            for vtk, (_, table) in marker.cells.by_type.items()
            for row in table.tolist()
            if marker.name not in (low, high) and any(set(row) <= nodes for nodes in sets)
        ]
        markers.append(Marker(marker.name, _joined(marker.cells, more)))
    full = Mesh(np.concatenate([mesh.points, moved]), cells, tuple(markers), name="halo")
    text = b"".join(su2_blocks(full)).decode()
    text = text.replace(f"NMARK= {len(markers)}", f"NMARK= {len(markers) + 2}")
    donors = [(partner[a], 1) for a in partner] + [(n, 2) for n in beyond]
    receivers = [(a, 1) for a in partner] + [(copy[n], 2) for n in beyond]
    for to, rows in ((1, donors), (-1, receivers)):
        lines = "".join(f"1 {node} {k}\n" for node, k in rows)
        text += f"MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= {len(rows)}\nSEND_TO= {to}\n{lines}"
    text += "NPERIODIC= 3\n"
    back = np.stack([centre, -transform[1], -shift])
    for index, rows in enumerate((np.zeros((3, 3)), -back * [[-1], [1], [1]], back)):
        lines = "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
        text += f"PERIODIC_INDEX= {index}\n{lines}"
    return text


def _joined(cells: Cells, more: Sequence[tuple[int, Sequence[int]]]) -> Cells:
    """The cells and some more after them."""
    types = [*cells.types.tolist(), *(vtk for vtk, _ in more)]
    return Cells.from_types(types, [*cells.connectivity, *(n for _, row in more for n in row)])
