import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from slideviz.case.model import Case
from slideviz.color_scheme import COLOR_MAP
from slideviz.errors import MeshError, SlidevizError
from slideviz.export.offscreen_renderer import picture, pictures_alike
from slideviz.mesh.quality import quality
from slideviz.scene.actors import CELL, POINT, VALUES
from slideviz.scene.overview import Detail, half_of, tiny_motion
from slideviz.scene.scene import Scene
from slideviz.session.changes import set_view
from slideviz.session.opening import session_of_runs
from slideviz.session.state import Run, StepFrame


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGBA")).astype(int)


def shown(mesh, base=None):
    """A session that shows a mesh, deformed or not."""
    if base is None:
        return session_of_runs(StepFrame(mesh, quality(mesh)))
    frame = StepFrame(mesh, quality(mesh, base))
    return session_of_runs(StepFrame(base, quality(base)), [Run(1, Case(), (frame,), "done")])


def has(image, rgb, within=10):
    return int((np.abs(image[..., :3] - np.asarray(rgb)).max(axis=2) <= within).sum())


def test_a_2d_mesh_is_shown_whole_on_white_with_its_quality(tmp_path, square):
    file = tmp_path / "q.png"
    picture(shown(square), file, size=(800, 500))
    image = pixels(file)
    assert image.shape[:2] == (500, 800)
    assert image[-2, 2].tolist() == [255, 255, 255, 255]
    best = np.array(pv.LookupTable(COLOR_MAP, scalar_range=(0, 1)).map_value(1.0)[:3]) * 255
    assert has(image, best) > 20_000, "squares are perfect"
    assert (image[:40, :400, :3].max(axis=2) < 90).sum() > 100, "a title in black"
    dark = np.array(pv.LookupTable(COLOR_MAP, scalar_range=(0, 1)).map_value(0.0)[:3]) * 255
    assert has(image[:, 650:], dark, 14) > 10, "the color bar begins at 0"


def test_the_half_of_a_3d_mesh_shows_the_hole_that_moved(tmp_path, cube):
    points = cube.points.copy()
    points[cube.marker("BLOCK").nodes] += [0.0, 0.06, 0.02]
    moved = cube.with_points(points)
    cells, towards, up = half_of(moved, cube)
    assert 0 < len(cells) < len(cube.cells)
    across = int(np.argmax(np.abs(towards)))
    assert across == 0, "cut along the motion"
    assert up[across] == 0
    file = tmp_path / "q.png"
    picture(shown(moved, cube), file, (400, 300))
    assert (pixels(file)[..., :3].min(axis=2) < 200).sum() > 10_000


def test_other_endings_are_refused(tmp_path, square):
    with pytest.raises(
        SlidevizError, match=r"pictures are PNG, or web pages .*; end the name with \.png or \.html"
    ):
        picture(shown(square), tmp_path / "a.jpg", size=(100, 80))
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_told(tmp_path, square):
    with pytest.raises(MeshError, match="folder"):
        picture(shown(square), tmp_path / "no" / "a.png", size=(100, 80))


def far_field(half_width):
    """A square hole of unit width in the middle of a wide square, and the same with it moved."""
    from slideviz.mesh.model import Cells, Marker, Mesh

    inner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2.0
    points = np.concatenate([inner, 2.0 * half_width * inner])
    ring = np.arange(4)
    after = (ring + 1) % 4
    quads = np.stack([ring + 4, after + 4, after, ring], axis=1)
    markers = (
        Marker("body", Cells.from_blocks([(3, np.stack([ring, after], 1))])),
        Marker("far", Cells.from_blocks([(3, np.stack([ring + 4, after + 4], 1))])),
    )
    mesh = Mesh(points, Cells.from_blocks([(9, quads)]), markers, name="far")
    moved = points.copy()
    moved[:4, 0] += 0.2
    return mesh, mesh.with_points(moved)


def test_what_moves_is_shown_in_detail_when_it_is_tiny_in_the_mesh(tmp_path):
    mesh, moved = far_field(50.0)
    detail = tiny_motion(moved, mesh)
    assert detail.centre == pytest.approx((0.1, 0.0))
    assert 2.0 < detail.width < 6.0
    assert tiny_motion(far_field(5.0)[1], far_field(5.0)[0]) is None
    assert tiny_motion(mesh, mesh) is None
    points = mesh.points.copy()
    points[4:] *= 1.1
    assert tiny_motion(mesh.with_points(points), mesh) is None, "the outer boundary moved"
    holes = {}
    for zoom in ("auto", "all", Detail((0.1, 0.0), 2.4)):
        picture(shown(moved, mesh), tmp_path / "a.png", size=(600, 400), zoom=zoom)
        image = pixels(tmp_path / "a.png")
        holes[str(zoom)] = has(image[60:, 100:400], [255, 255, 255], 0)
        if zoom == "auto":
            pale = (image[..., :3].min(axis=2) > 160) & (image[..., :3].max(axis=2) > 200)
            assert pale[12:26, 20:300].mean() > 0.5, "letters lie on a plate"
            assert pale[100:300, 590:].mean() > 0.95, "so does the color bar"
            assert not pale[390:, 100:500].any(), "the mesh is all around"
    assert 5 * 5 < holes["auto"] < holes[str(Detail((0.1, 0.0), 2.4))]
    wide = 500 / 2.4
    assert holes[str(Detail((0.1, 0.0), 2.4))] == pytest.approx(wide**2, rel=0.25)


def test_a_detail_needs_a_coordinate_for_each_direction(tmp_path, square):
    with pytest.raises(SlidevizError, match=r"about 0, 1, 2 is not a place in a 2D mesh; give 2"):
        picture(
            shown(square), tmp_path / "a.png", size=(100, 80), zoom=Detail((0.0, 1.0, 2.0), 1.0)
        )
    with pytest.raises(SlidevizError, match=r"a picture of 20x9000 pixels cannot be drawn; .* 64"):
        picture(shown(square), tmp_path / "a.png", size=(20, 9000))
    assert not list(tmp_path.iterdir())


def test_a_part_of_a_3d_mesh_is_drawn_with_its_outside_and_follows_the_steps(cube, plotter):
    cells, _, _ = half_of(cube, cube)
    scene, session = Scene(plotter), shown(cube.with_points(cube.points * 1.5), cube)
    for _ in scene.opening(set_view(session, frame=0, color_by="size-skew"), (), cells):
        pass
    shape = plotter.actors["cells"].mapper.dataset
    assert scene.polygons == shape.n_cells
    assert set(shape.cell_data[CELL]) <= set(cells)
    assert not scene.drawn, "no boundary of the other half"
    nodes = shape.point_data[POINT]
    scene.update(session)
    assert np.allclose(shape.points, 1.5 * cube.points[nodes])
    values = session.frame.quality.values
    assert np.allclose(shape.cell_data[VALUES], values[shape.cell_data[CELL]])


def test_pictures_to_compare_have_one_camera_and_no_legend(square):
    wide, high = (square.with_points(square.points * scale) for scale in ([2.0, 1.0], [1.0, 2.0]))
    images = pictures_alike([StepFrame(mesh, quality(mesh)) for mesh in (wide, high)], square, 200)
    boxes = [np.ptp(np.argwhere(image.min(axis=2) < 250), axis=0) for image in images]
    assert boxes[0] == pytest.approx(boxes[1][::-1], abs=2)
    assert boxes[0][1] == pytest.approx(2 * boxes[0][0], abs=4)
    assert boxes[0][1] > 0.85 * 200
