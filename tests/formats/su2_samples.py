"""Small SU2 files, random meshes, and what it means that two meshes are the same."""

from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from slideviz.mesh.check import LARGEST
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, Marker, Mesh

SQUARE = """\
NDIME= 2
NELEM= 3
9 0 1 4 3 0
5 1 2 5 1
5 1 5 4 2
NPOIN= 6
0.1 0.3 0
1.1 0.3 1
2.1 0.3 2
0.1 1.7 3
1.1 1.7 4
2.1 1.7 5
NMARK= 2
MARKER_TAG= lower
MARKER_ELEMS= 2
3 0 1
3 1 2
MARKER_TAG= upper
MARKER_ELEMS= 1
3 3 4
"""

# One cell of each kind; a coordinate is an infinite binary fraction wherever it may be.
SOLID = """\
NDIME= 3
NELEM= 4
12 0 1 2 3 4 5 6 7 0
14 4 5 6 7 8 1
13 1 9 2 5 10 6 2
10 5 10 6 8 3
NPOIN= 11
0.1 0.1 0.1 0
1.1 0.1 0.1 1
1.1 1.1 0.1 2
0.1 1.1 0.1 3
0.1 0.1 1.1 4
1.1 0.1 1.1 5
1.1 1.1 1.1 6
0.1 1.1 1.1 7
0.6 0.6 1.7 8
1.9 0.6 0.1 9
1.9 0.6 1.1 10
NMARK= 2
MARKER_TAG= floor
MARKER_ELEMS= 2
9 0 3 2 1
5 1 2 9
MARKER_TAG= tip
MARKER_ELEMS= 1
5 10 6 8
"""

# All that a file may have: comments, blank lines, tabs, CRLF, odd spacing and case, no trailing
# indices on some lines, unknown sections, halo markers, two counts after NPOIN.
MESSY = (
    "% made by hand, with = and numbers 1 2 3\r\n"
    "\r\n"
    "ndime =2 % flat\r\n"
    "AOA_OFFSET= 0.25\r\n"
    "AOS_OFFSET=0\r\n"
    "NPOIN=6\t4\r\n"
    "% here come the points\r\n"
    "  0.1\t0.3   0\r\n"
    "+1.10E+00 3.0e-1 1 7\r\n"
    "\r\n"
    "2.1 .3 2 % a point\r\n"
    "1.E-1 1.7 3\r\n"
    "% between points\r\n"
    "\t1.1 1.7\t4\r\n"
    "2.1 1.7 5\r\n"
    "NELEM   =   3\r\n"
    " 9  0 1 4 3\r\n"
    "5 1 2 5 1 % a cell\r\n"
    "5\t1\t5\t4\r\n"
    "Nmark=4\r\n"
    "MARKER_TAG=lower % the name\r\n"
    "MARKER_ELEMS=2\r\n"
    "3 0 1\r\n"
    "3 1 2 1\r\n"
    "MARKER_TAG= SEND_RECEIVE\r\n"
    "MARKER_ELEMS= 2\r\n"
    "SEND_TO= 1\r\n"
    "1 4 2\r\n"
    "1 5 2\r\n"
    "MARKER_TAG\t=\tupper wall\r\n"
    "MARKER_ELEMS= 1\r\n"
    "3 3 4\r\n"
    "MARKER_TAG= SEND_RECEIVE\r\n"
    "MARKER_ELEMS= 1\r\n"
    "SEND_TO= -1\r\n"
    "1 0 2\r\n"
    "NPERIODIC= 1\r\n"
    "PERIODIC_INDEX= 0\r\n"
    "0.0 0.0 0.0\r\n"
    "0.0 0.0 0.0\r\n"
    "0.0 0.0 0.0\r\n"
    "FFD_NBOX= 1\r\n"
    "FFD_TAG= box\r\n"
    "FFD_CORNER_POINTS= 1\r\n"
    "-0.1 -0.25\r\n"
    "FFD_SURFACE_POINTS= 1\r\n"
    "lower\t1\t0.5\t0.5"
)

ZONES = f"NZONE= 2\nIZONE= 1\n{SQUARE}IZONE= 2\n{SOLID}FFD_NBOX= 0\n"

SAMPLES = {"square": SQUARE, "solid": SOLID, "messy": MESSY, "zones": ZONES}


def shared_meshes() -> list[Path]:
    """Return the large real meshes, where they are at hand."""
    shared = Path(__file__).parents[2] / ".." / "shared" / "meshes"
    return sorted(path.resolve() for path in shared.glob("*/*.su2"))


def save(folder: Path, text: str | bytes, name: str = "grid.su2") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def bits(points: np.ndarray) -> bytes:
    return np.ascontiguousarray(points).tobytes()


def assert_same(a: Mesh, b: Mesh) -> None:
    """Check that two meshes agree in every bit."""
    assert a.points.shape == b.points.shape
    assert bits(a.points) == bits(b.points)
    assert a.cells.same_as(b.cells)
    assert a.marker_names == b.marker_names
    for one, other in zip(a.markers, b.markers, strict=True):
        assert one.cells.same_as(other.cells)


names = st.text(
    st.characters(categories=["L", "N", "P", "S"], exclude_characters="%"), min_size=1, max_size=8
).filter(lambda name: name.upper() != "SEND_RECEIVE" and name.isprintable())


@st.composite
def cell_lists(draw: st.DrawFn, dim: int, n_points: int, most: int) -> Cells:
    kinds = [row for row in ELEMENTS.values() if row.dim == dim]
    chosen = draw(st.lists(st.sampled_from(kinds), min_size=1, max_size=most))
    nodes = [draw(st.permutations(range(n_points)))[: row.n_nodes] for row in chosen]
    return Cells.from_types([row.vtk for row in chosen], [i for part in nodes for i in part])


@st.composite
def meshes(draw: st.DrawFn) -> Mesh:
    """Return meshes of random cells: nonsense as a grid, but any file must keep them."""
    dim = draw(st.sampled_from([2, 3]))
    n_points = draw(st.integers(8, 11))
    number = st.floats(-LARGEST, LARGEST)
    points = draw(st.lists(number, min_size=n_points * dim, max_size=n_points * dim))
    markers = [
        Marker(name, draw(cell_lists(dim - 1, n_points, 3)))
        for name in draw(st.lists(names, max_size=3, unique=True))
    ]
    return Mesh(
        np.array(points).reshape(-1, dim), draw(cell_lists(dim, n_points, 5)), tuple(markers)
    )
