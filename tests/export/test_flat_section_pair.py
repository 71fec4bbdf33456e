"""Pictures of a section of two runs that are compared: both in one file, alike in all but shape."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from PIL import Image

from slideviz.errors import CaseError
from slideviz.export.flat_section import save_section
from slideviz.mesh.quality import quality
from slideviz.plots import section_picture
from slideviz.plots.section_picture import SectionStyle, arrangement
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.jobs import Job
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.builders import cube, passage, square
from tests.slow import one_of_each_fast

PAPERS = [SectionStyle.of_cm(8.5, 6.4), SectionStyle.of_cm(17.0, 10.6), SectionStyle((1600, 1000))]
LEVEL = Section("plane", (0.5, 0.5, 0.4))


def compared(mesh):
    """A session with two runs side by side, one of which deforms more."""
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    for sliding, part in (("ps", 0.1), ("ds", 0.2)):
        session = changes.start_run(changes.set_case(session, sliding=sliding))
        push = part * np.prod(np.sin(np.pi * mesh.points), axis=1)
        moved = mesh.with_points(mesh.points + np.eye(mesh.dim)[0] * push[:, None])
        frames = [StepFrame(moved, quality(moved, mesh))]
        session = changes.end_run(changes.add_frames(session, frames), "done")
    session = changes.set_view(session, color_by="size-skew", color_range=(0.2, 0.9))
    return changes.show_beside(changes.show_run(session, 2), 1)


@pytest.fixture
def save(tmp_path, monkeypatch):
    """Save a section and return its figure."""
    drawn = []
    real = section_picture.draw_section
    monkeypatch.setattr(
        section_picture, "draw_section", lambda *v: drawn.append(real(*v)) or drawn[-1]
    )

    def run(session, section=LEVEL, paper=PAPERS[1]):
        file = tmp_path / "a.png"
        save_section(file, session, section, paper, Job())
        with Image.open(file) as image:
            assert image.size[0] == paper.size[0]
        return drawn[-1]

    return run


def titles(figure):
    """Return the title of the picture, and that of each section."""
    return [*figure.texts, *(axes.title for axes in figure.axes)]


def words(figure):
    return [line for text in titles(figure) for line in text.get_text().split("\n")]


def bars(figure):
    return [bar for axes in figure.axes for bar in axes.child_axes]


def test_both_runs_are_in_the_picture_alike_with_one_bar(save):
    figure = save(compared(cube(4, block=False)))
    first, second = figure.axes
    assert len(bars(figure)) == 1, "one color bar"
    assert (first.get_xlim(), first.get_ylim()) == (second.get_xlim(), second.get_ylim())
    shapes = [axes.collections[0] for axes in (first, second)]
    assert all(isinstance(one, PolyCollection) for one in shapes)
    faces = [one.get_facecolor() for one in shapes]
    assert not np.allclose(*faces)
    said = words(figure)
    assert "plane z = 0.4" in said
    assert any(line.startswith("Run 2, direct sliding") for line in said)
    assert any(line.startswith("step 1: min 0.") for line in said)
    assert said.index("Run 2, direct sliding") < said.index("Run 1, pseudo sliding")


def test_the_first_is_what_stands_to_the_left(save):
    session = changes.set_view(compared(cube(4, block=False)), swapped=True)
    said = words(save(session))
    assert said.index("Run 1, pseudo sliding") < said.index("Run 2, direct sliding")


def test_beside_the_undeformed_mesh_that_is_said(save):
    session = changes.show_beside(compared(cube(4, block=False)), changes.UNDEFORMED)
    assert "Undeformed" in words(save(session))


def test_one_view_is_one_section_as_before(save):
    session = changes.show_beside(compared(cube(4, block=False)), None)
    assert len(save(session).axes) == 1


def test_curves_along_a_line_are_in_one_plot(save):
    figure = save(compared(square(8, block=False)), Section("plane", (0.5, 0.4, 0), (0, 1, 0)))
    (axes,) = figure.axes
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels[:2] == ["Run 1, pseudo sliding", "Run 2, direct sliding"]


@pytest.mark.parametrize(
    "section",
    [
        Section("cylinder", radius=0.75),
        pytest.param(
            Section("cone", (0.0, 0.0, -2.0), half_angle_deg=16.0), marks=pytest.mark.slow
        ),
    ],
)
def test_what_goes_around_an_axis_lies_flat_in_the_same_place(save, section):
    mesh = passage()
    first, second = save(compared(mesh), section).axes
    assert first.get_xlim() == second.get_xlim()
    centres = [axes.collections[0].get_datalim(axes.transData).y0 for axes in (first, second)]
    assert centres[0] == pytest.approx(centres[1], abs=0.05)


def test_a_section_beside_the_mesh_is_refused(save):
    with pytest.raises(CaseError, match="it cuts no cell, so there is nothing to draw"):
        save(compared(cube(4, block=False)), Section("plane", (0.5, 0.5, 7.0)))


@pytest.mark.parametrize(
    ("stretch", "paper"),
    one_of_each_fast([(1.0, 4.0, 1.0), (1.0, 1.0, 1.0), (5.0, 1.0, 1.0)], PAPERS),
)
def test_nothing_in_the_picture_overlaps(save, stretch, paper):
    mesh = cube(4, block=False)
    session = compared(mesh.with_points(mesh.points * stretch))
    figure = save(session, paper=paper)
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in titles(figure)]
    for axes in figure.axes:
        axes.title.set_visible(False)
    beside = {id(bar): bar.get_tightbbox() for bar in bars(figure)}
    boxes += beside.values()
    for bar in bars(figure):
        bar.set_visible(False)
    boxes += [axes.get_tightbbox() for axes in figure.axes]
    width, height = figure.get_size_inches() * figure.dpi
    for one, other in combinations(boxes, 2):
        across = min(one.x1, other.x1) - max(one.x0, other.x0)
        along = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert min(across, along) < 1.0
    for box in boxes:
        assert min(box.x0, box.y0) >= 0
        assert (box.x1, box.y1) <= (width, height)


def test_long_shapes_are_above_each_other_and_high_ones_beside():
    page = (6.7, 4.2)
    for size, beside in (((4.0, 1.0), False), ((1.0, 3.0), True)):
        assert arrangement(np.array(size), page, 2)[0] is beside
    narrow, _ = arrangement(np.array((1.0, 3.0)), (3.3, 2.5), 2)
    assert not narrow, "titles beside each other would be too small there"
