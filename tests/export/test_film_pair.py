"""Films of two runs beside each other: one camera, one range, the steps that belong together."""

import numpy as np
import pytest
from PIL import Image

from slideviz.deformation.solver import deform
from slideviz.errors import SlidevizError
from slideviz.export import film_pair as module
from slideviz.export.film_pair import Told, film_pair, pair_size
from slideviz.export.offscreen import font_scale
from slideviz.export.reel import Reel
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.session.state import Frame

SIZE = (800, 400)
USUAL = Reel(SIZE)


@pytest.fixture(scope="module")
def made():
    return sample("passage", 12)


@pytest.fixture(scope="module")
def runs(made):
    """Four steps with pseudo sliding, and two steps with all sides held."""

    def told(name, **changes):
        case = made.case.change(**changes)
        meshes = [made.mesh, *(step.mesh for step in deform(case, made.mesh))]
        return Told(name, [Frame(mesh, quality(mesh, reference=made.mesh)) for mesh in meshes])

    held = {"sliding": "none", "periodic": "none"}
    return told("SLIDING_MODE= ps", steps=4), told("SLIDING_MODE= none", steps=2, **held)


def shoot(runs, file, reel=USUAL, **options):
    drawn = list(film_pair(runs, file, reel, **options))
    return drawn[-1].done


@pytest.fixture
def told(monkeypatch):
    """Words above the pictures, in the order in which they are written."""
    words = []
    write = module.write_title

    def tell(plotter, text, *rest):
        words.append((text, rest[-1]))
        write(plotter, text, *rest)

    monkeypatch.setattr(module, "write_title", tell)
    return words


def test_each_run_has_its_half_its_name_and_its_numbers(runs, tmp_path, told):
    assert shoot(runs, tmp_path / "p_%d.png") == 5
    pairs = list(zip(told[::2], told[1::2], strict=True))
    lines = [(left[0].split("\n"), right[0].split("\n")) for left, right in pairs]
    assert {left[0] for left, _ in lines} == {"SLIDING_MODE= ps"}
    assert {right[0] for _, right in lines} == {"SLIDING_MODE= none"}
    last = [run.frames[-1].quality for run in runs]
    assert lines[-1][0][1] == f"step 4 of 4: min {last[0].min:.4f}, mean {last[0].mean:.4f}"
    assert lines[-1][1][1].startswith(f"step 2 of 2: min {last[1].min:.4f}")
    # As far deformed: the run of two steps is half way when that of four is.
    assert lines[2][1][1].startswith("step 1 of 2")
    with Image.open(tmp_path / "p_4.png") as image:
        assert image.size == SIZE


def test_both_halves_are_one_picture_when_the_runs_are_the_same(runs, tmp_path):
    twice = Told("a", runs[0].frames), Told("a", runs[0].frames)
    shoot(twice, tmp_path / "p_%d.png", colour_by="displacement")
    with Image.open(tmp_path / "p_4.png") as image:
        whole = np.asarray(image).astype(int)
    (width, _), strip = pair_size(SIZE)
    left, right = whole[:, : width - strip], whole[:, SIZE[0] - width : SIZE[0] - strip]
    assert np.array_equal(left, right), "one camera, one range of colours"
    assert (left.min(axis=2) < 100).any()
    bar = whole[:, SIZE[0] - strip + round(10 * font_scale(SIZE)) :]
    assert (np.ptp(bar, axis=2) > 100).any(), "the colour bar is at the right"


def test_the_range_of_displacements_holds_both_runs(runs, tmp_path, monkeypatch):
    ranges = []
    show = module.Portrait.show

    def spy(self, frame):
        ranges.append(tuple(self._mapper.scalar_range))
        show(self, frame)

    monkeypatch.setattr(module.Portrait, "show", spy)
    first = runs[0].frames[0].mesh
    far = first.with_points(first.points + np.array([3.0, 0.0]))
    moved = Told("far", [runs[0].frames[0], Frame(far, quality(far, reference=first))])
    for pair in ((runs[0], moved), (moved, runs[0])):
        ranges.clear()
        shoot(pair, tmp_path / "p_%d.png", colour_by="displacement", overwrite=True)
        assert len(set(ranges)) == 1
        assert ranges[0] == pytest.approx((0.0, 3.0))


def test_images_in_between_are_there_for_both(runs, tmp_path, told):
    assert shoot(runs, tmp_path / "p_%02d.png", Reel(SIZE, between=1)) == 9
    second = [text.split("\n")[1] for text, _ in told[1::2]]
    assert second[1].startswith("step 0.25 of 2, interpolated")
    assert second[4].startswith("step 1 of 2: min")
    assert len({letters for _, letters in told}) == 1, "words must not tremble"


def test_long_names_have_smaller_letters(runs, tmp_path, told):
    shoot(runs, tmp_path / "a_%d.png")
    usual = told[0][1]
    told.clear()
    shoot((Told("KEY= value, " * 7, runs[0].frames), runs[1]), tmp_path / "b_%d.png")
    assert told[0][1] < usual


def test_what_cannot_be_is_told(runs, tmp_path):
    other = sample("passage", 13).mesh
    frames = [Frame(other, quality(other))] * 2
    with pytest.raises(SlidevizError, match="must deform the same mesh"):
        shoot((runs[0], Told("b", frames)), tmp_path / "a.gif")
    with pytest.raises(SlidevizError, match="no steps to make a film of"):
        shoot((runs[0], Told("b", runs[0].frames[:1])), tmp_path / "a.gif")
    with pytest.raises(SlidevizError, match=r"300x300 pixels are too narrow.*take 390 or more"):
        shoot(runs, tmp_path / "a.gif", Reel((300, 300)))
    assert pair_size((390, 300))
    assert not list(tmp_path.iterdir())
