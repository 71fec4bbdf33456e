"""A view as one web page that can be turned: what a scene draws, as triangles and lines.

Nothing in the page comes from a network; WebGL draws it, by ``web_page.html``.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.mesh.model import FloatArray, IntArray, row_norms
from slideviz.scene.legend import has_inverted
from slideviz.scene.scene import Scene
from slideviz.session.state import Session
from slideviz.terms import COLOR_BY, ROLES

_PAGE = Path(__file__).with_suffix(".html")
_BOLD = 1.5  # width in pixels from which a line is drawn bold
_TURN = "drag: turn; right button or Shift: move; wheel: zoom; double click: as at first"
_MOVE = "drag: move; wheel: zoom; double click: as at first"


@dataclass
class _Group:
    """Triangles or lines that are drawn alike."""

    lines: bool = False
    bold: bool = False
    glass: bool = False  # half-transparent
    lit: bool = False
    places: list[FloatArray] = field(default_factory=list)
    """Of (n, 3): 3 points for each triangle, 2 for each line, in the mesh's length unit."""
    colors: list[FloatArray] = field(default_factory=list)
    """Of (n, 4): red, green, blue and opacity of the points, 0 to 255."""

    def add(self, points: FloatArray, color: FloatArray) -> None:
        """Add points (k, c, 3) of k triangles or lines, with a color (4,) or colors (k, 4)."""
        corners = points.shape[1]
        self.places.append(points.reshape(-1, 3))
        self.colors.append(np.repeat(np.broadcast_to(color, (len(points), 4)), corners, axis=0))

    def data(self, middle: FloatArray, unit: float) -> dict[str, Any]:
        """Return what the page has of the group, relative to a point, in a unit of length."""
        places = (np.concatenate(self.places) - middle) / unit
        colors = np.concatenate(self.colors).round().astype(np.uint8)
        return vars(self) | {
            "count": len(places),
            "places": b64encode(places.astype("<f4").tobytes()).decode(),
            "colors": b64encode(colors.tobytes()).decode(),
        }


def web_page(scene: Scene, session: Session, title: str) -> str:
    """Return the page of what a scene draws of a session, from the scene's camera.

    Drawn are surfaces, sections, lines and edges, not points and the words beside them.
    """
    flat = session.mesh is not None and session.mesh.dim == 2
    groups = {
        "solid": _Group(lit=not flat),
        "edges": _Group(lines=True),
        "bold": _Group(lines=True, bold=True),
        "glass": _Group(glass=True, lit=not flat),
    }
    for actor in scene.plotter.renderer.actors.values():
        if isinstance(actor, pv.Actor) and actor.visibility and actor.mapper.dataset is not None:
            _add(groups, actor)
    camera = scene.plotter.camera
    back = -np.array(camera.direction)
    up = np.array(camera.up) - back * (back @ camera.up)
    up /= np.linalg.norm(up)
    width, height = scene.plotter.window_size
    focus = np.array(camera.focal_point)
    scale = camera.parallel_scale
    if not camera.parallel_projection:
        scale = camera.distance * np.tan(np.radians(camera.view_angle / 2.0))
    drawn = [group for group in groups.values() if group.places]
    places = [each for group in drawn for each in group.places]
    farthest = max((row_norms(each - focus).max() for each in places), default=scale)
    data = {
        "groups": [group.data(focus, scale) for group in drawn],
        "turn": np.concatenate([np.cross(up, back), up, back]).tolist(),
        "wide": width / height,
        "depth": float(1.1 * farthest / scale),
        "flat": flat,
    }
    parts = {
        "TITLE": escape(title),
        "LEGEND": _legend(scene, session),
        "HELP": _MOVE if flat else _TURN,
        "DATA": json.dumps(data),
    }
    return re.sub("@([A-Z]+)@", lambda mark: parts[mark[1]], _PAGE.read_text(encoding="utf-8"))


def _add(groups: dict[str, _Group], actor: Any) -> None:
    """Add what an actor draws to the groups."""
    mapper = actor.mapper
    prop = actor.prop
    shape = mapper.dataset
    origin = np.arange(shape.n_cells)
    if not isinstance(shape, pv.PolyData):
        shape = shape.extract_surface(algorithm="geometry", pass_cellid=True)
        origin = shape.cell_data["vtkOriginalCellIds"]
    matrix = pv.array_from_vtkmatrix(actor.GetMatrix())
    points = np.asarray(shape.points, float) @ matrix[:3, :3].T + matrix[:3, 3]
    opaque = 255.0 * prop.opacity
    colors = np.array([*prop.color.int_rgb, opaque])
    lines = _links(shape.GetLines(), closed=False)
    if len(lines):
        groups["bold" if prop.line_width > _BOLD else "edges"].add(points[lines], colors)
    if not shape.GetNumberOfPolys() or prop.style != "Surface":
        return
    faces = pv.PolyData(shape.points, faces=shape.faces)
    if mapper.scalar_visibility:
        cells = origin[len(origin) - faces.n_cells :]  # points and lines come first
        colors = np.asarray(pv.convert_array(mapper.MapScalars(prop.opacity)))[cells].astype(float)
    faces.cell_data["face"] = np.arange(faces.n_cells)
    triangles = faces.triangulate()
    corners = points[triangles.regular_faces]
    owner = triangles.cell_data["face"]
    group = groups["glass" if prop.opacity < 1.0 else "solid"]
    group.add(corners, colors[owner] if colors.ndim == 2 else colors)
    if prop.show_edges:
        edge = np.array([*prop.edge_color.int_rgb, 0.8 * opaque])  # thinner than those of VTK
        groups["edges"].add(points[_links(shape.GetPolys(), closed=True)], edge)


def _links(cells: Any, *, closed: bool) -> IntArray:
    """Return the pieces (k, 2) of a vtkCellArray of lines, or the sides of polygons, each once."""
    nodes = np.asarray(pv.convert_array(cells.GetConnectivityArray()))
    offsets = np.asarray(pv.convert_array(cells.GetOffsetsArray()))
    last = offsets[1:] - 1
    following = np.arange(1, len(nodes) + 1)
    following[last] = offsets[:-1]
    ends = np.column_stack([nodes, nodes[following]]) if len(nodes) else np.empty((0, 2), int)
    if not closed:
        return np.delete(ends, last, axis=0)
    return np.unique(np.sort(ends, axis=1), axis=0)


def _legend(scene: Scene, session: Session) -> str:
    """Return the legend: the roles in use, or the bar of colors with its numbers."""
    what = session.view.color_by
    if what == "role":
        used = {session.role(name) for name in session.opened_mesh.marker_names}
        keys = [(ROLES[role].color, ROLES[role].label) for role in ROLES if role in used]
        return "".join(_key(*key) for key in keys)
    low, high = session.color_range
    table = scene.stage.table
    shades = [pv.Color(table.map_value(value)).hex_rgb for value in np.linspace(low, high, 17)]
    numbers = (f"<span>{value:.4g}</span>" for value in np.linspace(high, low, 5))
    bar = f"<i style='background: linear-gradient(0deg, {', '.join(shades)})'></i>"
    title = escape(COLOR_BY[what].axis)
    inverted = _key(table.nan_color.hex_rgb, "inverted") if has_inverted(session) else ""
    return f"{title}<div class='bar'>{bar}<div>{''.join(numbers)}</div></div>{inverted}"


def _key(color: str, words: str) -> str:
    return f"<div class='role'><i style='background: {color}'></i>{words}</div>"
