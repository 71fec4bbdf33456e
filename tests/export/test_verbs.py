"""The verbs of the library do what the commands do."""

from pathlib import Path

import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError
from slideviz.samples.table import write_sample


@pytest.fixture
def square(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_sample("square", tmp_path, 8)
    case = sv.Case.read("square.cfg")
    return case, sv.read("mesh.su2")


def test_a_section_is_that_of_the_command(square):
    _, mesh = square
    line = sv.Section("plane", (0.0, 0.4, 0.0), (0.0, 1.0, 0.0), whole_cells=True)
    shown = sv.section("ours.svg", mesh, line)
    assert len(shown.ids) == 6  # two of the eight are in the block
    with pytest.raises(CaseError, match="misses the mesh"):
        sv.section("far.svg", mesh, sv.Section("plane", (0.0, 9.0, 0.0), (0.0, 1.0, 0.0)))
    with pytest.raises(CaseError, match="a section is drawn as"):
        sv.section("a.bmp", mesh, line)


def test_a_picture_is_that_of_the_command(square):
    case, mesh = square
    *_, last = sv.deform(case.change(steps=1), mesh)
    assert run(["run", "square.cfg", "--steps", "1", "-q", "-o", "mesh_def.su2",
                "--picture", "theirs.png", "--picture-size", "400x300"]) == 0  # fmt: skip
    moved = sv.read("mesh_def.su2")
    sv.picture("ours.png", moved, mesh, case=case, step=last, size=(400, 300))
    assert Path("ours.png").read_bytes() == Path("theirs.png").read_bytes()


def test_a_film_has_the_steps(square):
    from PIL import Image

    case, mesh = square
    steps = sv.deform(case.change(steps=2), mesh)
    sv.film("a.gif", mesh, steps, case=case, size=(300, 200), fps=10.0)
    with Image.open("a.gif") as image:
        assert image.n_frames == 3
    with pytest.raises(sv.SlidevizError, match=r"a\.gif"):
        sv.film("a.gif", mesh, (), case=case, size=(300, 200))


def test_unknown_words_are_refused_with_those_there_are(square):
    case, mesh = square
    line = sv.Section("plane", (0.0, 0.4, 0.0), (0.0, 1.0, 0.0))
    with pytest.raises(CaseError, match=r"color: 'skw' is not one of size-skew .*mean skew\?"):
        sv.section("a.svg", mesh, line, color="skw")
    with pytest.raises(CaseError, match="color_map: 'jet' is not one of viridis"):
        sv.section("a.svg", mesh, line, color_map="jet")
    with pytest.raises(CaseError, match="color: 'role' is not one of size-skew"):
        sv.film("a.gif", mesh, sv.deform(case, mesh), case=case, color="role")
    with pytest.raises(sv.SlidevizError, match=r"zoom: 'al' is not one of auto \| all"):
        sv.picture("a.png", mesh, zoom="al")
    assert not list(Path.cwd().glob("a.*"))
