"""The web page of a view: complete in itself, with what the scene draws."""

import json
import re
import shutil
import subprocess
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from slideviz.export.offscreen_renderer import OffscreenRenderer, picture
from slideviz.export.picture_options import PictureOptions
from slideviz.mesh.quality import INVERTED, quality
from slideviz.samples.table import sample
from slideviz.scene.actors import lookup_table
from slideviz.sections.model import Section
from slideviz.session.changes import add_section, set_view
from slideviz.session.opening import session_of_runs
from slideviz.session.state import StepFrame
from slideviz.terms import ROLES


def session_of(mesh):
    return session_of_runs(StepFrame(mesh, quality(mesh)))


def parsed(text):
    """The data of a page, its groups with their places (n, 3) and colors (n, 4)."""
    data = json.loads(re.search(r"const page = (\{.*\});", text)[1])
    for group in data["groups"]:
        places, colors = (b64decode(group[key]) for key in ("places", "colors"))
        group["places"] = np.frombuffer(places, "<f4").reshape(-1, 3)
        group["colors"] = np.frombuffer(colors, np.uint8).reshape(-1, 4)
        assert len(group["places"]) == len(group["colors"]) == group["count"]
    return data


def test_nothing_comes_from_a_network_and_colors_are_those_of_the_cells(tmp_path, square):
    session = session_of(square)
    file = tmp_path / "a<b>.html"
    picture(session, file, size=(400, 300))
    text = file.read_text(encoding="utf-8")
    assert not re.search(r"http|src=|href=|import|url\(|@[A-Z]+@", text)
    data = parsed(text)
    assert data["flat"]
    cells, edges, bold = data["groups"]
    assert (cells["lines"], cells["lit"], edges["lines"], bold["bold"]) == (
        False,
        False,
        True,
        True,
    )
    assert cells["count"] == 3 * 2 * len(square.cells)
    best = np.round(255.0 * np.array(lookup_table().map_value(1.0, opacity=False)))
    np.testing.assert_allclose(
        cells["colors"][:, :3], np.broadcast_to(best[:3], (cells["count"], 3))
    )
    assert bold["count"] == 2 * sum(len(marker.cells) for marker in square.markers)
    sides = {tuple(sorted(map(tuple, pair))) for pair in edges["places"].reshape(-1, 2, 3).tolist()}
    assert len(sides) == edges["count"] / 2, "each side once"
    areas = np.cross(*np.diff(cells["places"].reshape(-1, 3, 3), axis=1).swapaxes(0, 1))[:, 2] / 2.0
    extent = np.ptp(cells["places"][:, :2], axis=0)
    assert np.abs(areas).sum() == pytest.approx(extent.prod(), rel=1e-5), "the square is covered"
    assert "<span>0</span>" in text
    assert "linear-gradient" in text


def test_inverted_cells_are_red_and_roles_have_their_legend(tmp_path, square):
    session = session_of(square)
    first = session.first
    status = first.quality.status.copy()
    status[0] = INVERTED
    session = replace(session, first=replace(first, quality=replace(first.quality, status=status)))
    picture(session, tmp_path / "a.html", size=(400, 300))
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    red = np.round(255.0 * np.array(lookup_table().nan_color.float_rgb))
    assert (parsed(text)["groups"][0]["colors"][:, :3] == red).all(axis=1).sum() in (3, 6)
    assert "inverted</div>" in text
    session = set_view(session_of(square), color_by="role")
    with OffscreenRenderer(session, ()) as renderer:
        renderer.write(PictureOptions((400, 300)), tmp_path / "b.html")
    text = (tmp_path / "b.html").read_text(encoding="utf-8")
    assert ROLES["fixed"].label in text
    assert "linear-gradient" not in text


@pytest.fixture(scope="module")
def stator():
    return session_of(sample("stator", 5000).mesh)


def test_a_section_and_the_camera_are_those_of_the_view(tmp_path, stator):
    mesh = stator.mesh
    cut = Section("plane", tuple(mesh.points.mean(axis=0)), (0.0, 0.0, 1.0))
    session = add_section(set_view(stator, color_by="size-skew"), cut)
    with OffscreenRenderer(session, ()) as renderer:
        renderer.write(PictureOptions((400, 300)), tmp_path / "a.html")
        camera = renderer.aim(PictureOptions((400, 300))).plotter.camera
        data = parsed((tmp_path / "a.html").read_text(encoding="utf-8"))
        turn = np.reshape(data["turn"], (3, 3))
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        np.testing.assert_allclose(turn @ camera.direction, (0.0, 0.0, -1.0), atol=1e-9)
        places = np.concatenate([group["places"] for group in data["groups"]])
        assert np.linalg.norm(places, axis=1).max() < data["depth"]
        height = (cut.origin[2] - camera.focal_point[2]) / camera.parallel_scale
    at_cut = [np.abs(group["places"][:, 2] - height) < 1e-5 for group in data["groups"]]
    assert sum(map(np.count_nonzero, at_cut)) > 1000
    assert not data["flat"]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs the browser chromium")
def test_a_browser_draws_and_turns_it(tmp_path, stator):
    """The picture has the colors of the cells, and another shape when turned."""
    page = tmp_path / "a.html"
    picture(stator, page, size=(600, 400))
    turned = tmp_path / "b.html"
    text = page.read_text(encoding="utf-8")
    turned.write_text(text.replace("\nreset();\n", "\nreset();\nrotate(0.9, 0.4);\ndraw();\n"))
    drawn = []
    for file in (page, turned):
        call = ["chromium", "--headless=new", "--no-sandbox", "--use-gl=angle"]
        call += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        call += ["--window-size=600,400", f"--user-data-dir={tmp_path / 'browser'}"]
        shot = file.with_suffix(".png")
        call += ["--virtual-time-budget=4000", f"--screenshot={shot}", file.as_uri()]
        subprocess.run(call, capture_output=True, timeout=300, check=True)
        with Image.open(shot) as image:
            drawn.append(np.asarray(image.convert("RGB")).astype(int))
    for image in drawn:
        yellow = (image[..., 0] > 120) & (image[..., 2] < 90)
        assert yellow.mean() > 0.1
    assert (np.abs(drawn[0] - drawn[1]).max(axis=2) > 60).mean() > 0.03
