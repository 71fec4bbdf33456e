"""Pictures of sections: what is drawn where, in which color, and the files."""

import re
from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from PIL import Image

from slideviz.color_scheme import COLOR_MAP, INVERTED_COLOR
from slideviz.errors import CaseError
from slideviz.mesh.metrics import metric
from slideviz.mesh.periodic import match
from slideviz.mesh.quality import quality
from slideviz.plots import cells as plot_cells
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import (
    SectionInRun,
    SectionStyle,
    draw_section,
    in_space,
    section_picture,
)
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session.passages import passages, show_passages
from slideviz.terms import METRICS, QUANTITIES, WALL_VALUES
from tests.builders import cube, passage, square
from tests.slow import one_of_each_fast


def bent(mesh):
    """The mesh with its inside pushed along x, so that cells differ in quality."""
    push = 0.1 * np.prod(np.sin(np.pi * mesh.points), axis=1)
    return mesh.with_points(mesh.points + np.eye(mesh.dim)[0] * push[:, None])


def folded(mesh):
    """The mesh with the node nearest to the middle pulled beyond its neighbours."""
    points = mesh.points.copy()
    middle = np.argmin(np.linalg.norm(points - 0.5, axis=1))
    points[middle] += 0.4
    return mesh.with_points(points)


def drawn(mesh, section, count=0, base=None, names=None, by="size-skew", **style):
    """The figure, its collection, and the paint."""
    painted = paint(mesh, quality(mesh, base), by, base)
    matrices = passages(match(base or mesh, *names), count) if names else {0: np.eye(4)}
    pieces = show_passages(Cutter(mesh), mesh.points, section, matrices)
    figure = draw_section([SectionInRun(pieces, painted)], section, SectionStyle(**style))
    (shapes,) = figure.axes[0].collections
    return figure, shapes, painted


def words_of(figure):
    """The lines of the title, and what is written into a picture in space."""
    return [line for text in figure.texts for line in text.get_text().split("\n")]


def bar_of(figure):
    """The axes of the color bar."""
    (bar,) = [bar for axes in figure.axes for bar in axes.child_axes]
    return bar


def bar_says(figure):
    return [text.get_text() for text in bar_of(figure).texts]


def test_cells_have_the_colors_of_their_values():
    base = cube(4, block=False)
    mesh = bent(base)
    section = Section("plane", (0, 0, 0.4))
    _, shapes, painted = drawn(mesh, section, base=base)
    assert isinstance(shapes, PolyCollection)
    cells = Cutter(mesh).which_cells(mesh.points, section)
    assert len(shapes.get_paths()) == len(cells) == 16
    faces = shapes.get_facecolor()
    assert np.ptp(painted.values[cells]) > 0.02
    for path, face in zip(shapes.get_paths(), faces, strict=True):
        at = np.array([*path.vertices[:4].mean(axis=0), 0.375])
        nodes = mesh.points[mesh.cells.by_type[12][1]].mean(axis=1)
        cell = cells[np.argmin(np.linalg.norm(nodes[cells] - at, axis=1))]
        assert face == pytest.approx(mpl.colormaps[COLOR_MAP](painted.values[cell]))


@pytest.mark.parametrize(
    ("size", "high"),
    one_of_each_fast([(1004, 756), (2953, 1654), (600, 300)], [0.3, 2.0]),
)
def test_numbers_of_a_narrow_range_do_not_run_together(size, high):
    mesh = cube(4, block=False)
    mesh = mesh.with_points(mesh.points * [1.0, high, 1.0])
    painted = paint(mesh, quality(mesh), "size-skew").within(0.946, 0.967)
    section = Section("plane", (0, 0, 0.4))
    pieces = show_passages(Cutter(mesh), mesh.points, section, {0: np.eye(4)})
    figure = draw_section(
        [SectionInRun(pieces, painted)], section, SectionStyle(size, trimmed=True)
    )
    figure.draw_without_rendering()
    axes = bar_of(figure)
    upright = axes.get_position().height > axes.get_position().width
    labels = (axes.get_yticklabels() if upright else axes.get_xticklabels())[:]
    words = [label.get_text() for label in labels]
    assert (words[0], words[-1]) == ("0.946", "0.967")
    boxes = [label.get_window_extent() for label in labels]
    ends = [(box.y0, box.y1) if upright else (box.x0, box.x1) for box in boxes]
    assert all(one[1] < other[0] for one, other in pairwise(ends))


def test_inverted_cells_are_red_on_top_and_explained():
    base = cube(6, block=False)
    mesh = folded(base)
    section = Section("plane", (0.5, 0.5, 0.55), (0, 0, 1))
    figure, shapes, painted = drawn(mesh, section, base=base)
    ids = Cutter(mesh).which_cells(mesh.points, section)
    number = int(painted.inverted[ids].sum())
    assert number > 0
    red = np.all(np.isclose(shapes.get_facecolor(), to_rgba(INVERTED_COLOR)), axis=1)
    assert red.sum() >= number
    assert red[-number:].all()
    assert bar_says(figure) == ["inverted"]
    assert f"{number} inverted" in words_of(figure)[-1]
    whole, _, _ = drawn(base, section)
    assert bar_says(whole) == []
    assert "inverted" not in words_of(whole)[-1]


def test_the_title_has_min_and_mean_of_the_cut_alone():
    base = cube(6, block=False)
    mesh = bent(base)
    section = Section("plane", (0, 0, 0.1))
    figure, _, painted = drawn(mesh, section, base=base)
    values = painted.values[Cutter(mesh).which_cells(mesh.points, section)]
    first, second = words_of(figure)
    assert first == "plane z = 0.1"
    assert second == (f"size-skew: min {values.min():.4f}, mean {values.mean():.4f}; 36 cells cut")
    assert values.min() > painted.values.min()


def test_copies_lie_side_by_side_and_count_once():
    mesh = passage()
    section = Section("cylinder", radius=0.7)
    one, single, _ = drawn(mesh, section)
    figure, shapes, _ = drawn(mesh, section, count=2, names=("per1", "per2"))
    assert len(shapes.get_paths()) == 5 * len(single.get_paths())
    assert words_of(figure) == words_of(one)
    high = max(path.vertices[:, 1].max() for path in shapes.get_paths())
    low = min(path.vertices[:, 1].min() for path in shapes.get_paths())
    assert high - low == pytest.approx(5 * 0.7 * np.radians(30))
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("z", "r θ")


def test_a_wheel_unrolls_to_its_circumference():
    mesh = passage()
    section = Section("cylinder", radius=0.7)
    _, shapes, _ = drawn(mesh, section, count="wheel", names=("per1", "per2"))
    around = np.concatenate([path.vertices[:, 1] for path in shapes.get_paths()])
    assert np.ptp(around) == pytest.approx(0.7 * 2 * np.pi)


@pytest.mark.parametrize(
    ("size", "box"),
    one_of_each_fast(
        [(1600, 1000), (600, 400), (400, 1600), (3000, 600)], [(1, 1), (8, 1), (1, 8), (40, 1)]
    ),
)
def test_both_directions_have_one_scale_and_nothing_leaves_the_picture(size, box):
    mesh = cube(4, block=False)
    mesh = folded(mesh.with_points(mesh.points * (*box, 1.0)))
    section = Section("plane", (0, 0, 0.4))
    figure, shapes, _ = drawn(mesh, section, size=size, base=cube(4, block=False))
    assert figure.get_size_inches() * figure.dpi == pytest.approx(size)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    assert axes.transData.get_matrix()[0, 0] == pytest.approx(axes.transData.get_matrix()[1, 1])
    corners = np.concatenate([path.vertices for path in shapes.get_paths()])
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    assert (low < corners.min(axis=0)).all()
    assert (high > corners.max(axis=0)).all()
    (title,) = figure.texts
    parts = [title.get_window_extent(), axes.get_tightbbox()]
    assert not parts[0].overlaps(parts[1])
    for part in parts:
        assert min(part.x0, part.y0) >= 0
        assert part.x1 <= size[0]
        assert part.y1 <= size[1]


@pytest.mark.parametrize("size", [(1600, 1000), (600, 400)])
def test_letters_are_not_smaller_than_8_points_and_inside(size):
    mesh = passage()
    section = Section("plane", (0.6, 0.3, 0.2), (1, 0.2, 0.3))
    figure, _, _ = drawn(mesh, section, size=size, name="a_very_long_name_" * 12)
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    letters = [*figure.texts]
    for axes in (*figure.axes, bar_of(figure)):
        letters += [axes.xaxis.label, axes.yaxis.label]
        letters += [*axes.get_xticklabels(), *axes.get_yticklabels(), *axes.texts]
    for text in letters:
        if not text.get_text() or not text.get_visible():
            continue
        assert text.get_fontsize() >= 8
        if text in figure.texts:
            box = text.get_window_extent(renderer)
            assert box.x0 >= 0
            assert box.x1 <= size[0]
            assert box.y1 <= size[1]
    assert "…" in words_of(figure)[0]
    assert f": {section.describe()} " in " ".join(words_of(figure)), "in a line or two"


def test_a_direction_that_finds_no_room_is_named_by_its_largest_part():
    mesh = cube(4, block=False)
    section = Section("plane", (0.5, 0.5, 0.5), (0.0, 0.1, 1.0))
    for size, label in ((1600, 1600), "along (0, 0.995, -0.0995)"), ((1600, 380), "y′"):
        figure, _, _ = drawn(mesh, section, size=size)
        assert figure.axes[0].get_ylabel() == label
        assert figure.axes[0].get_xlabel() == "x"


def test_thin_cells_have_thin_lines_and_lines_can_be_left_out():
    base = cube(6, block=False)
    squeezed = base.with_points(base.points ** np.array([4.0, 1.0, 1.0]))
    section = Section("plane", (0, 0, 0.4))
    _, shapes, _ = drawn(squeezed, section)
    widths = shapes.get_linewidths()
    sizes = [np.ptp(path.vertices[:, 0]) for path in shapes.get_paths()]
    assert widths[np.argmin(sizes)] < 0.3 * widths[np.argmax(sizes)]
    # Moved to whole pixels by the widths of their own lines, neighbours would not meet.
    assert shapes.get_snap() is False
    _, bare, _ = drawn(squeezed, section, edges=False)
    assert bare.get_edgecolor() == pytest.approx(bare.get_facecolor())


def test_in_space_the_nearest_polygon_is_last_and_axes_are_named():
    mesh = passage()
    section = Section("cylinder", radius=0.7, whole_cells=True)
    figure, shapes, _ = drawn(mesh, section, in_space=True)
    assert {"x", "y", "z"} <= set(words_of(figure))
    seen = in_space([Cutter(mesh).show(mesh.points, section)], section)
    depth = np.add.reduceat(seen.points[seen.connectivity, 2], seen.offsets[:-1]) / seen.sizes
    assert (np.diff(depth) >= 0).all()
    first = shapes.get_paths()[0].vertices[: seen.sizes[0]]
    assert first == pytest.approx(seen.points[seen.connectivity[: seen.sizes[0]], :2])


def test_a_2d_mesh_is_drawn_in_its_plane():
    mesh = square(6, block=False)
    section = Section("plane", (0, 0.4, 0), (0, 1, 0), whole_cells=True)
    figure, shapes, _ = drawn(mesh, section)
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("x", "y")
    assert isinstance(shapes, PolyCollection)
    assert len(shapes.get_paths()) == 6


@pytest.mark.parametrize("by", [by for by in QUANTITIES if by not in WALL_VALUES])
def test_every_number_can_be_drawn(by):
    base = cube(4, block=False)
    mesh = bent(base)
    figure, _, painted = drawn(mesh, Section("plane", (0, 0, 0.4)), base=base, by=by)
    assert words_of(figure)[-1].startswith(f"{by}: ")
    assert bar_of(figure).get_ylabel() == by
    if by == "displacement":
        length = np.linalg.norm(mesh.points - base.points, axis=1)
        assert painted.values == pytest.approx(length[base.cells.by_type[12][1]].mean(axis=1))
        assert painted.limits == (0.0, painted.values.max())
    else:
        assert np.array_equal(painted.values, metric(mesh, by, base).of_cells)
        low = METRICS[by].best == "low"
        assert f"{by}: {'max' if low else 'min'} " in words_of(figure)[-1]
        worst = painted.values[painted.summary(np.arange(len(mesh.cells)))["worst_cell"]]
        assert worst == (painted.values.max() if low else painted.values.min())


@pytest.mark.parametrize("by", WALL_VALUES)
def test_numbers_of_walls_have_colors_beside_walls_only(by):
    base = cube(4, block=False)
    moved = bent(base)
    found = paint(moved, quality(moved, base), by, base)
    inside = np.isnan(found.values)
    assert 0 < inside.sum() < len(inside)
    shown = found.shown(np.arange(len(inside)))
    assert np.isinf(shown[inside]).all()
    assert (shown[~inside] <= found.limits[1]).all()
    facts = found.summary(np.arange(len(inside)))
    assert facts["mean"] == pytest.approx(found.values[~inside].mean())
    assert facts["cells"] == len(inside)
    assert "no cell at a wall" in found.sentence(np.flatnonzero(inside))


def test_a_range_ends_the_colors_but_no_valid_cell_turns_red():
    base = cube(4, block=False)
    painted = paint(base, quality(base), "size-skew").within(1.5, 2.0)
    assert painted.shown(np.arange(5)).tolist() == [1.5] * 5
    with pytest.raises(CaseError, match="color range 2 to 1: the first number must be"):
        painted.within(2.0, 1.0)


def test_displacement_needs_the_undeformed_mesh():
    mesh = cube(4, block=False)
    for reference in (None, cube(5, block=False)):
        with pytest.raises(CaseError, match="give that mesh as reference"):
            paint(mesh, quality(mesh), "displacement", reference)


def save(file, **style):
    mesh = cube(4, block=False)
    section = Section("plane", (0, 0, 0.4))
    pieces = {0: Cutter(mesh).cut(mesh.points, section)}
    painted = paint(mesh, quality(mesh), "size-skew")
    section_picture([SectionInRun(pieces, painted)], section, file, SectionStyle(**style))


@pytest.mark.parametrize("size", [(1600, 1000), (640, 481)])
def test_a_png_has_the_size_that_was_asked_for(tmp_path, size):
    save(tmp_path / "x.png", size=size)
    image = Image.open(tmp_path / "x.png").convert("RGB")
    assert image.size == size
    yellow = np.array(mpl.colormaps[COLOR_MAP](1.0)[:3]) * 255
    near = np.abs(np.asarray(image, float) - yellow).max(axis=2) < 3
    assert near.mean() > 0.1


def test_svg_and_pdf_are_vectors_and_the_same_each_time(tmp_path):
    for suffix in ("svg", "pdf"):
        files = [tmp_path / f"{name}.{suffix}" for name in "ab"]
        for file in files:
            save(file)
        assert files[0].read_bytes() == files[1].read_bytes()
    svg = (tmp_path / "a.svg").read_text()
    assert "<image" not in svg
    assert len(re.findall("PolyCollection|<path", svg)) > 16
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


def test_very_many_polygons_become_pixels(tmp_path, monkeypatch):
    monkeypatch.setattr(plot_cells, "MANY", 10)
    save(tmp_path / "x.svg")
    assert "<image" in (tmp_path / "x.svg").read_text()


def test_what_cannot_be_drawn_or_written_says_so(tmp_path):
    with pytest.raises(CaseError, match=r"x\.jpg: a section is drawn as \.png, \.svg, \.pdf"):
        save(tmp_path / "x.jpg")
    with pytest.raises(CaseError, match="the folder does not exist"):
        save(tmp_path / "no" / "x.png")
    mesh = cube(4, block=False)
    painted = paint(mesh, quality(mesh), "size-skew")
    section = Section("plane", (0, 0, 3))
    pieces = {0: Cutter(mesh).cut(mesh.points, section)}
    with pytest.raises(CaseError, match="plane z = 3: it cuts no cell"):
        section_picture([SectionInRun(pieces, painted)], section, tmp_path / "x.png")
    assert not list(tmp_path.iterdir())


def test_a_strip_leaves_no_empty_paper():
    mesh = cube(4, block=False)
    long = mesh.with_points(mesh.points * (8.0, 1.0, 1.0))
    section = Section("plane", (0, 0, 0.4))
    whole, *_ = drawn(long, section, size=(1600, 1000))
    figure, *_ = drawn(long, section, size=(1600, 1000), trimmed=True)
    assert figure.get_figwidth() == whole.get_figwidth()
    assert figure.get_figheight() < 0.7 * whole.get_figheight()
    boxes = [
        one.axes[0].get_position().bounds * np.tile(one.get_size_inches(), 2)
        for one in (whole, figure)
    ]
    assert boxes[0][2:] == pytest.approx(boxes[1][2:]), "as large as before"
    # All of it is on the paper, without much room above and below.
    heights = [
        limit
        for text in figure.texts
        for limit in text.get_window_extent(figure.canvas.get_renderer()).intervaly
    ]
    bars = [axes.get_tightbbox().intervaly for axes in figure.axes]
    lowest, highest = min(map(min, bars)), max(heights)
    assert 0 <= lowest < 0.4 * figure.dpi
    assert 0 <= figure.bbox.height - highest < 0.4 * figure.dpi


def test_a_square_section_fills_its_picture_as_before():
    mesh = cube(4, block=False)
    section = Section("plane", (0, 0, 0.4))
    whole, *_ = drawn(mesh, section, size=(1600, 1000))
    figure, *_ = drawn(mesh, section, size=(1600, 1000), trimmed=True)
    assert figure.get_figheight() == pytest.approx(whole.get_figheight(), abs=0.01)


def test_a_thin_strip_has_two_numbers_on_its_short_side():
    for height in (0.009, 0.016, 0.0245):
        mesh = cube(6, block=False)
        mesh = mesh.with_points((mesh.points - (0.0, 0.5, 0.5)) * (0.35, 2.0 * height, 2.0))
        figure, _, _ = drawn(mesh, Section("plane", (0, 0, 0.1)), size=(1600, 1000), trimmed=True)
        axes = figure.axes[0]
        low, high = axes.get_ylim()
        assert sum(low <= tick <= high for tick in axes.get_yticks()) >= 2


def test_without_title_and_axes_the_section_has_the_room():
    mesh = cube(4, block=False)
    section, sizes = Section("plane", (0, 0, 0.4)), []
    for shown in (True, False):
        figure, _, _ = drawn(mesh, section, size=(1004, 756), dpi=300.0, title=shown, axes=shown)
        figure.draw_without_rendering()
        sizes.append(figure.axes[0].bbox.width)
        assert bool(words_of(figure)) is shown
        assert figure.axes[0].axison is shown
        assert bar_of(figure).get_ylabel() == "size-skew", "the colors are always explained"
    assert sizes[1] > 1.4 * sizes[0]
