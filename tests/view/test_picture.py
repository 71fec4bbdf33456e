import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from slideviz.errors import MeshError, SlidevizError
from slideviz.mesh.quality import quality
from slideviz.view import changes
from slideviz.view.look import COLOUR_MAP
from slideviz.view.picture import picture, picture_of
from slideviz.view.state import Frame
from slideviz.view.surfaces import find_surfaces


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGBA")).astype(int)


def has(image, rgb, within=10):
    return int((np.abs(image[..., :3] - np.asarray(rgb)).max(axis=2) <= within).sum())


def test_a_2d_mesh_is_shown_whole_on_white_with_its_quality(tmp_path, square):
    file = tmp_path / "q.png"
    picture(square, file, size=(800, 500))
    image = pixels(file)
    assert image.shape[:2] == (500, 800)
    assert image[-2, 2].tolist() == [255, 255, 255, 255]
    best = np.array(pv.LookupTable(COLOUR_MAP, scalar_range=(0, 1)).map_value(1.0)[:3]) * 255
    assert has(image, best) > 20_000, "squares are perfect"
    assert (image[:40, 200:600, :3].max(axis=2) < 90).sum() > 100, "a title in black"
    dark = np.array(pv.LookupTable(COLOUR_MAP, scalar_range=(0, 1)).map_value(0.0)[:3]) * 255
    assert has(image[:, 650:], dark, 14) > 10, "the colour bar begins at 0"


def test_the_half_of_a_3d_mesh_shows_the_hole_that_moved(tmp_path, cube):
    from slideviz.view.actors import volume
    from slideviz.view.picture import _half

    points = cube.points.copy()
    points[cube.marker("BLOCK").nodes] += [0.0, 0.06, 0.02]
    moved = cube.with_points(points)
    half, towards, up = _half(volume(moved), moved, cube)
    assert 0 < half.n_cells < len(cube.cells)
    across = int(np.argmax(np.abs(towards)))
    assert across == 0, "cut along the motion"
    assert up[across] == 0
    file = tmp_path / "q.png"
    picture(moved, file, cube, quality(moved, cube), (400, 300))
    assert (pixels(file)[..., :3].min(axis=2) < 200).sum() > 10_000


def test_other_endings_are_refused(tmp_path, square):
    with pytest.raises(SlidevizError, match=r"pictures are PNG; end the name with \.png"):
        picture(square, tmp_path / "a.jpg", size=(100, 80))
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_told(tmp_path, square):
    with pytest.raises(MeshError, match="folder"):
        picture(square, tmp_path / "no" / "a.png", size=(100, 80))


def test_the_view_can_be_drawn_at_any_size_and_without_background(tmp_path, square):
    session = changes.open_mesh(Frame(square, quality(square)), None)
    surfaces = find_surfaces(square)
    picture_of(session, surfaces, tmp_path / "a.png", size=(640, 300))
    picture_of(session, surfaces, tmp_path / "b.png", size=(320, 500), transparent=True)
    assert pixels(tmp_path / "a.png").shape == (300, 640, 4)
    image = pixels(tmp_path / "b.png")
    assert image.shape == (500, 320, 4)
    assert image[2, 2, 3] == 0
    assert image[250, 100, 3] == 255
