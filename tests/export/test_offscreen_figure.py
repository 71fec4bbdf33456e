"""Pictures of a view: what is in them, and where."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from slideviz.color_scheme import PAPER, SELECTED_COLOR
from slideviz.errors import SlidevizError
from slideviz.export import offscreen_renderer as renderer_module
from slideviz.export import vector
from slideviz.export.film import FilmOptions, draw_images, film_steps
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import (
    TITLE_ROOM,
    PictureOptions,
    line_between,
    panes,
    size_words,
    title_of,
)
from slideviz.export.titles import fitting, mark_words, pair_titles
from slideviz.export.vector import draw_vector, require_vector, write_vector
from slideviz.formats.losses import left_out
from slideviz.formats.table import FORMATS, formats_for, holds_quality
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.mesh import FADED
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import changes, jobs
from slideviz.session.opening import open_mesh
from slideviz.session.pieces import run_to_end
from slideviz.session.state import StepFrame
from slideviz.terms import ROLES

PLAIN = PictureOptions((400, 300), legend=False)


def session_of(mesh):
    return open_mesh(StepFrame(mesh, quality(mesh)), None)


@pytest.fixture
def session(square):
    found = changes.start_run(session_of(square))
    for scale in (1.02, 1.05):
        moved = square.with_points(square.points * [scale, 1.0])
        found = changes.add_frames(found, [StepFrame(moved, quality(moved, square))])
    return changes.set_view(changes.end_run(found, "done"), color_by="size-skew")


@pytest.fixture
def renderer(session, square):
    with OffscreenRenderer(session, find_surfaces(square)) as made:
        yield made


def drawn(image):
    """Return the rows and columns from where to where something is drawn."""
    ink = (image[..., :3] < 250).any(axis=2)
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    return rows[0], rows[-1], columns[0], columns[-1]


def test_the_mesh_stands_in_the_middle_of_a_white_picture(renderer):
    top, bottom, left, right = drawn(renderer.image(PLAIN))
    assert abs((top + bottom) / 2 - 150) < 4
    assert abs((left + right) / 2 - 200) < 4
    assert bottom - top > 0.85 * 300


def test_the_legend_has_its_strip_and_the_title_its_line(renderer):
    _, _, _, right = drawn(renderer.image(replace(PLAIN, legend=True)))
    assert right > 350
    bare, titled = renderer.image(PLAIN), renderer.image(replace(PLAIN, title=True))
    assert drawn(titled)[0] < drawn(bare)[0]
    mesh_top = drawn(titled[60:])[0] + 60
    assert mesh_top > 20, "the title does not lie on the mesh"
    assert drawn(renderer.image(PLAIN)) == drawn(bare), "the title is gone again"


def test_edges_and_axes_are_drawn_when_wanted(renderer):
    def colors(figure):
        return len(np.unique(renderer.image(figure).reshape(-1, 3), axis=0))

    assert colors(PLAIN) > 1.5 * colors(replace(PLAIN, edges=False))
    with_axes = renderer.image(replace(PLAIN, triad=True))
    assert (with_axes != renderer.image(PLAIN)).any()


def test_backgrounds(renderer):
    clear = renderer.image(replace(PLAIN, background="transparent"))
    assert clear.shape == (300, 400, 4)
    assert clear[2, 2, 3] == 0
    assert clear[150, 200, 3] == 255
    assert (renderer.image(PLAIN)[2, 2] == 255).all()


def test_a_preview_is_the_picture_made_small(renderer):
    # With a short title: letters have whole sizes, so that a long one is not quite as small.
    renderer.session = changes.show_frame(renderer.session, 0)
    figure = PictureOptions((1200, 900), letters=1.5, legend=False, title=True)
    small = figure.within((400, 400))
    assert small.size == (400, 300)
    assert small.scale == pytest.approx(figure.scale / 3)
    places = np.array(drawn(renderer.image(figure))) / 3
    assert np.abs(places - drawn(renderer.image(small))).max() < 6
    assert figure.within((5000, 5000)).size == figure.size


def test_two_runs_have_the_same_room_and_the_same_scale(renderer, session, square):
    more = changes.start_run(session)
    moved = square.with_points(square.points * [1.0, 0.5])
    more = changes.add_frames(more, [StepFrame(moved, quality(moved, square))])
    renderer.session = changes.show_beside(changes.show_run(more, 1), 2)
    left, right = panes(PictureOptions((801, 300)), 9)
    assert left.size[0] + 9 + right.size[0] == 801
    assert not left.legend
    both = renderer.image(replace(PLAIN, size=(800, 300)))
    low = round(TITLE_ROOM * PLAIN.scale)  # below the names of the runs
    first, second = drawn(both[low:, :395]), drawn(both[low:, 405:])
    assert first[3] - first[2] == pytest.approx(1.05 * (second[3] - second[2]), rel=0.03)
    assert first[1] - first[0] == pytest.approx(2 * (second[1] - second[0]), rel=0.05)
    renderer.session = changes.set_view(renderer.session, swapped=True)
    other = renderer.image(replace(PLAIN, size=(800, 300)))
    assert np.ptp(drawn(other[low:, 405:])[2:]) > second[3] - second[2]
    renderer.session = changes.show_beside(renderer.session, changes.UNDEFORMED)
    assert renderer.beside.frame is session.first


@pytest.mark.parametrize("background", ["white", "transparent"])
@pytest.mark.parametrize("letters", [0.5, 1.25, 3.0])
def test_between_two_pictures_there_are_a_line_and_the_background(
    renderer, session, square, background, letters
):
    renderer.session = changes.show_beside(session, changes.UNDEFORMED)
    options = replace(PLAIN, size=(800, 300), letters=letters, background=background)
    # Zoomed in, the mesh reaches both edges of its picture.
    camera = renderer.aim(options).plotter.camera
    camera.parallel_scale = 0.1 * camera.parallel_scale
    image = run_to_end(renderer.render_steps(options, aim=False))
    start = panes(options, options.gap)[0].size[0]
    between, line = image[:, start : start + options.gap], line_between(options)
    assert (image[150, start - 1, :3] != 255).any()
    empty = (255, 255, 255, 0)[: image.shape[2]]
    dark = (*(round(255 * part) for part in to_rgb(PAPER.edge)), 255)[: image.shape[2]]
    aside = np.delete(between, np.r_[line], axis=1)
    assert (aside == empty).all()
    assert (between[:, line] == dark).all()
    assert 0 < line.stop - line.start <= options.gap
    figure = draw_vector(renderer, replace(options, background="white"))
    (drawn_line,) = [one for one in figure.get_children() if one.get_gid() == "between"]
    assert start < drawn_line.get_xdata()[0] * 800 < start + options.gap


def test_what_is_selected_is_not_marked_in_a_picture(renderer, square):
    plain = renderer.image(PLAIN)
    renderer.session = changes.select(renderer.session, square.marker_names[:1])
    assert (renderer.image(PLAIN) == plain).all()


def test_titles_say_run_method_step_and_quality(session):
    wide, narrow = PictureOptions((3000, 300), title=True), PictureOptions((200, 300), title=True)
    assert title_of(session, wide).startswith("Run 1, no sliding, step 2 of 2: min ")
    assert "mean" in title_of(session, wide)
    assert "mean" not in title_of(session, narrow)
    assert "step 1 of 2" in title_of(changes.show_frame(session, 1), wide)
    assert title_of(changes.show_frame(session, 0), wide).startswith("Undeformed: min")
    named = changes.rename_run(session, 1, "stiff blade")
    assert title_of(named, wide).startswith("Run 1, stiff blade, step 2")


def test_titles_of_runs_of_one_method_say_what_sets_them_apart(session):
    session = changes.start_run(changes.set_case(session, kernel="wendland-c4"))
    session = changes.end_run(changes.add_frames(session, session.runs[0].frames[:1]), "done")
    wide = PictureOptions((3000, 300), title=True)
    assert title_of(session, wide).startswith("Run 2, no sliding, CP C4: min")
    other = changes.start_run(changes.set_case(session, sliding="ps"))
    other = changes.add_frames(other, session.runs[0].frames[:1])
    assert title_of(other, wide).startswith("Run 3, pseudo sliding: min")


def test_pictures_of_two_runs_name_both_also_without_titles(session, renderer, monkeypatch):
    second = changes.start_run(changes.set_case(session, sliding="ps"))
    second = changes.end_run(changes.add_frames(second, session.runs[0].frames), "done")
    renderer.session = changes.show_beside(changes.show_run(second, 1), 2)
    written = []
    write = renderer_module.write_title
    monkeypatch.setattr(
        renderer_module,
        "write_title",
        lambda p, text, *rest: (written.append(text), write(p, text, *rest)),
    )
    renderer.image(replace(PLAIN, size=(1600, 400)))
    assert written == ["Run 1, no sliding", "Run 2, pseudo sliding"]
    renderer.image(replace(PLAIN, both=False))
    assert len(written) == 2, "alone it has none"


def two_runs(session, **settings):
    """A session with a second run beside the first."""
    second = changes.start_run(changes.set_case(session, **settings))
    second = changes.end_run(changes.add_frames(second, session.runs[0].frames), "done")
    return changes.show_beside(changes.show_run(second, 1), 2)


def test_titles_of_two_runs_have_one_form_and_all_that_sets_them_apart(session, renderer):
    pair = two_runs(session, sliding="ds", periodic="fixed")
    renderer.session = pair
    first, second = pair, renderer.beside
    lines = pair_titles((first, second), quality=True)
    assert lines[0].startswith("Run 1, no sliding, not periodic\nstep 2 of 2: min 0.")
    assert lines[1].startswith("Run 2, direct sliding, fixed vertices\nstep 2 of 2: min 0.")
    renderer.session = changes.show_beside(pair, changes.UNDEFORMED)
    lines = pair_titles((renderer.session, renderer.beside), quality=True)
    assert lines[0].startswith("Run 1, no sliding\nstep 2 of 2: min 0.")
    assert lines[1] == "Undeformed\nmin 1.0000, mean 1.0000"
    again = renderer.image(replace(PLAIN, size=(900, 400), title=True))
    assert drawn(again[:, :440])[0] > 0, "both lines are in the picture"


def test_a_picture_of_another_step_has_it_in_both_views(session, renderer):
    renderer.session = two_runs(session, sliding="ds")
    for step in range(3):
        shown = renderer.shown(changes.show_frame(renderer.session, step), PLAIN)
        assert [one.view.frame for one in shown] == [step, step]
    (alone,) = renderer.shown(renderer.session, replace(PLAIN, both=False))
    assert alone is renderer.session


def test_titles_that_are_too_long_get_smaller_then_shorter():
    assert fitting(["ab\ncd", "efg"], 10.0) == (["ab\ncd", "efg"], 1.0)
    titles, part = fitting(["a" * 20, "b\nc"], 16.0)
    assert (titles, part) == (["a" * 20, "b\nc"], 0.8)
    titles, part = fitting(["a" * 100, "b"], 12.0)
    assert part == pytest.approx(0.6)
    assert titles == ["a" * 19 + "…", "b"]


def test_a_marked_cell_is_named_in_both_views_or_left_out(session, renderer):
    renderer.session = changes.mark_cell(two_runs(session, sliding="ds"), 5)
    color = np.array(to_rgb(SELECTED_COLOR)) * 255

    def orange(figure):
        image = renderer.image(figure)
        found = (np.abs(image.astype(float) - color).max(axis=2) < 8).any(axis=0)
        return found[: found.size // 2].any(), found[found.size // 2 :].any()

    wide = replace(PLAIN, size=(900, 300))
    assert orange(wide) == (True, True)
    words = renderer._plotter.actors["mark:words"].input
    value = renderer.session.frame.quality.values[5]
    assert words == f"cell 5: {value:.4f}"
    assert orange(replace(wide, marked=False)) == (False, False)
    assert "mark:words" not in renderer._plotter.actors
    assert mark_words(changes.set_view(renderer.session, color_by="role")) == "cell 5"
    assert "cell 5" in texts_of(draw_vector(renderer, wide))
    assert "cell 5" not in texts_of(draw_vector(renderer, replace(wide, marked=False)))


def texts_of(sheet):
    return "; ".join(text.get_text() for axes in sheet.axes for text in axes.texts)


def test_drawings_of_two_runs_stand_as_the_views_do(session, renderer):
    renderer.session = changes.set_view(two_runs(session, sliding="ds"), swapped=True)
    sheet = draw_vector(renderer, replace(PLAIN, size=(900, 300), title=True))
    left, right = sorted(sheet.texts, key=lambda text: text.get_position()[0])
    assert left.get_text().startswith("Run 2, direct sliding")
    assert right.get_text().startswith("Run 1, no sliding")


def test_a_film_has_the_titles_of_its_preview(session, renderer, tmp_path, monkeypatch):
    said = []
    write = renderer_module.write_title

    def keep(plotter, text, *rest):
        said.append(text)
        write(plotter, text, *rest)

    monkeypatch.setattr(renderer_module, "write_title", keep)
    figure = PictureOptions((640, 400), title=True, both=False, film=True)
    for _ in draw_images(film_steps(renderer, figure, tmp_path / "a%d.png", FilmOptions())):
        pass
    for frame in range(3):
        renderer.session = changes.show_frame(session, frame)
        renderer.image(figure.within((320, 300)))
    assert said[:3] == said[3:]
    assert said[2].startswith("Run 1, no sliding, step 2 of 2: min")


def test_sizes_in_words():
    assert size_words(PictureOptions((600, 300))) == "600 × 300 pixels"
    assert size_words(PictureOptions((600, 300), dpi=300.0)).startswith("5.1 × 2.5 cm on paper")


def test_what_cannot_be_drawn_or_written_is_told(renderer, tmp_path, cube, monkeypatch):
    with pytest.raises(SlidevizError, match="cannot be drawn"):
        renderer.image(PictureOptions((10, 300)))
    with pytest.raises(SlidevizError, match=r"end the name with \.png"):
        renderer.write(PLAIN, tmp_path / "a.jpg")
    with pytest.raises(SlidevizError, match="folder does not exist"):
        renderer.write(PLAIN, tmp_path / "no" / "a.png")
    with pytest.raises(SlidevizError, match="end the name with one of these"):
        require_vector(renderer.session, Path("a.png"))
    with pytest.raises(SlidevizError, match="only pictures of 2D meshes"):
        require_vector(session_of(cube), Path("a.svg"))
    monkeypatch.setattr(vector, "MOST_CELLS", 3)
    with pytest.raises(SlidevizError, match="too many to be drawn one by one"):
        require_vector(renderer.session, Path("a.pdf"))
    assert not list(tmp_path.iterdir())


def test_the_same_camera_for_pixels_and_lines(renderer):
    (x0, x1), (y0, y1) = renderer.window(PLAIN)
    points = renderer.session.frame.mesh.points
    _, bottom, left, right = drawn(renderer.image(PLAIN))
    unit = (x1 - x0) / 400
    assert unit == pytest.approx((y1 - y0) / 300)
    assert points[:, 0].min() == pytest.approx(x0 + left * unit, abs=3 * unit)
    assert points[:, 0].max() == pytest.approx(x0 + right * unit, abs=3 * unit)
    assert points[:, 1].min() == pytest.approx(y1 - bottom * unit, abs=3 * unit)
    sheet = draw_vector(renderer, PLAIN)
    assert sheet.axes[0].get_xlim() == pytest.approx((x0, x1))
    assert sheet.axes[0].get_ylim() == pytest.approx((y0, y1))


def test_drawings_are_whole_and_always_the_same(renderer, tmp_path):
    figure = replace(PLAIN, title=True, legend=True)
    for name in ("a.svg", "b.svg"):
        write_vector(renderer, figure, tmp_path / name)
    first = (tmp_path / "a.svg").read_bytes()
    assert first == (tmp_path / "b.svg").read_bytes()
    cells = len(renderer.session.mesh.cells)
    assert first.count(b"<path") >= cells
    renderer.session = changes.set_view(renderer.session, color_by="role", undeformed=True)
    write_vector(renderer, figure, tmp_path / "c.svg")
    roles = {renderer.session.role(name) for name in renderer.session.mesh.marker_names}
    text = (tmp_path / "c.svg").read_text()
    assert all(ROLES[role].color in text for role in roles)
    write_vector(renderer, replace(figure, background="transparent"), tmp_path / "d.pdf")
    assert (tmp_path / "d.pdf").read_bytes().startswith(b"%PDF")


def test_only_chosen_cells_are_drawn(renderer):
    renderer.session = changes.set_view(renderer.session, threshold=(2.0, 3.0))
    sheet = draw_vector(renderer, PLAIN)
    assert sum(len(one.get_paths()) for one in sheet.axes[0].collections[:1]) == 0


def test_a_drawing_has_the_sections_of_the_view_and_the_other_cells_faintly(renderer):
    line = Section("plane", (0.0, 1.5, 0.0), (0.0, 1.0, 0.0))
    circle = Section("cylinder", (2.0, 2.0, 0.0), radius=1.0, whole_cells=True)
    plain = draw_vector(renderer, PLAIN).axes[0]
    assert plain.collections[0].get_alpha() is None
    renderer.session = changes.set_view(renderer.session, sections=(line, circle))
    axes = draw_vector(renderer, PLAIN).axes[0]
    assert axes.collections[0].get_alpha() == FADED
    assert axes.get_xlim() == plain.get_xlim()
    mesh, values = renderer.session.frame.mesh, renderer.session.frame.quality.values
    cutter, extra = Cutter(mesh), [c for c in axes.collections if 1.0 < c.get_zorder() < 2.0]
    cut = cutter.cut(mesh.points, line)
    whole = cutter.show(mesh.points, circle)
    arrays = [c.get_array() for c in extra if c.get_array() is not None]
    for wanted in (values[cut.cells], values[whole.cells]):
        assert any(np.array_equal(one, wanted) for one in arrays)
    heights = [c.get_paths()[0].vertices for c in extra if len(c.get_paths()) == 1]
    assert any(ends[:, 1] == pytest.approx(1.5) for ends in heights), "the line itself"
    hidden = tuple(replace(one, shown=False) for one in (line, circle))
    renderer.session = changes.set_view(renderer.session, sections=hidden)
    assert len(draw_vector(renderer, PLAIN).axes[0].collections) == len(plain.collections)


def test_the_legend_of_a_drawing_lies_on_a_plate(renderer):
    figure = replace(PLAIN, legend=True)
    sheet = draw_vector(renderer, figure)
    (plate,) = [one for one in sheet.artists if one.get_gid() == "plate"]
    mesh, bar = sheet.axes
    assert mesh.get_zorder() < plate.get_zorder() < bar.get_zorder()
    box = plate.get_window_extent()
    assert box.x0 < bar.get_window_extent().x0
    assert box.y0 < bar.get_window_extent().y0 < bar.get_window_extent().y1 < box.y1
    clear = draw_vector(renderer, replace(figure, background="transparent"))
    assert not clear.artists


def test_whether_a_view_sees_all(renderer):
    scene = renderer.aim(PLAIN)
    view = OffscreenRenderer(scene.session, (), scene)
    assert view.fills
    scene.plotter.camera.parallel_scale *= 0.3
    assert not view.fills
    view.close()


def test_formats_and_what_they_leave_out(square, cube):
    assert ".bdf" not in formats_for(square)
    assert ".b8.ugrid" not in formats_for(square)
    # A case of OpenFOAM is written as a copy of the one that was read.
    assert set(formats_for(cube)) == set(FORMATS) - {".foam"}
    assert holds_quality(Path("a.VTU"))
    assert not holds_quality(Path("a.su2"))
    assert left_out(Path("a.su2"), square) == ""
    plain = replace(square, source=None)
    assert left_out(Path("a.vtu"), plain) == ""
    boxed = replace(plain, zones=2, origin=replace(plain.origin, ffd=b"FFD_NBOX= 1\n"))
    assert left_out(Path("a.vtu"), boxed) == (
        "a.vtu does not hold the FFD boxes and the other zones."
    )
    assert left_out(Path("a.msh"), plain) == "a.msh does not hold the quality of the cells."
    assert "numbers now" in left_out(Path("a.off"), plain)


def test_names_of_steps():
    names = [path.name for path in jobs.step_paths(Path("/x/a.su2"), 10)]
    assert names[0] == "a_01.su2"
    assert names[-1] == "a_10.su2"


def test_the_table_tells_inverted_cells_and_every_type(square, tmp_path):
    points = square.points.copy()
    inner = np.setdiff1d(np.arange(len(points)), square.marker(square.marker_names[0]).nodes)
    points[inner[len(inner) // 2]] += 10.0
    bad = square.with_points(points)
    said = []
    frame = StepFrame(bad, quality(bad, square))
    path = jobs.save_quality(tmp_path / "q.csv", frame, jobs.Job(said.append))
    lines = path.read_text().splitlines()
    assert len(lines) == 1 + len(bad.cells)
    assert sum(",inverted," in line for line in lines) == frame.quality.inverted > 0
    kind = ELEMENTS[int(bad.cells.types[0])].name
    assert lines[1].startswith(f"0,{kind},")
    assert said[0].fraction == 0.0
