"""Work in pieces: done at once it comes out the same, and in pieces nothing of it is missing."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv

from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.session import changes, pieces
from slideviz.session.opening import open_mesh
from slideviz.session.pieces import InThread, actor_groups, render_in_groups, run_inline, run_to_end
from slideviz.session.state import StepFrame

PLAIN = PictureOptions((300, 200))


def work(log, value=2):
    try:
        yield "begun"
        try:
            found = yield InThread(lambda going_on: 1 / value)
        except ZeroDivisionError:
            found = "none"
        yield None
        log.append(found)
        yield "middle"
        return found
    finally:
        log.append("tidied")


def test_what_may_be_done_beside_is_done_here_and_sent():
    log = []
    run = run_inline(work(log))
    assert list(run) == ["begun", None, "middle"]
    assert log == [0.5, "tidied"]
    assert run_to_end(work([])) == 0.5


def test_what_goes_wrong_beside_is_thrown_into_the_work():
    log = []
    assert run_to_end(work(log, 0)) == "none"
    assert log == ["none", "tidied"]

    def careless():
        yield InThread(lambda _: 1 / 0)

    with pytest.raises(ZeroDivisionError, match="division"):
        run_to_end(careless())


def test_work_that_is_closed_tidies_up():
    log = []
    run = run_inline(work(log))
    next(run)
    run.close()
    assert log == ["tidied"]


@pytest.fixture
def plotter():
    made = pv.Plotter(off_screen=True, window_size=[120, 80])
    for k, size in enumerate((3, 3, 5, 1)):
        made.add_mesh(pv.Plane(i_resolution=size, j_resolution=1), name=f"plane {k}")
    made.add_text("words", name="words")
    yield made
    made.close()


def named(plotter, parts):
    names = {actor: name for name, actor in plotter.renderer.actors.items()}
    return [[names[actor] for actor in part] for part in parts]


def test_portions_are_of_not_much_more_than_so_many_faces(plotter):
    actors = plotter.renderer.actors
    actors["plane 3"].SetVisibility(False)
    found = named(plotter, actor_groups(actors.values(), 6))
    assert found == [["plane 0", "plane 1"], ["plane 2", "words"]]
    assert named(plotter, actor_groups(actors.values(), 1)) == [
        ["plane 0"],
        ["plane 1"],
        ["plane 2", "words"],
    ]


def test_what_several_actors_share_counts_once(plotter):
    for k in range(3):
        copy = pv.Actor(mapper=plotter.renderer.actors["plane 3"].mapper, name=f"copy {k}")
        plotter.renderer.AddActor(copy)
    parts = actor_groups(plotter.renderer.actors.values(), 7)
    assert [len(part) for part in parts] == [2, 6]


@pytest.mark.parametrize("stop", [None, 1])
def test_what_appears_part_by_part_is_all_there_in_the_end(plotter, monkeypatch, stop):
    monkeypatch.setattr(pieces.actor_groups, "__defaults__", (6,))
    hidden = plotter.renderer.actors["plane 3"]
    hidden.SetVisibility(False)
    seen, drawn = [], []
    plotter.renderer.AddObserver("EndEvent", lambda *_: drawn.append(1))
    parts = render_in_groups(plotter)
    for _ in parts:
        seen.append([actor.GetVisibility() for actor in plotter.renderer.actors.values()])
        if len(seen) == stop:
            parts.close()
    whole_scene = [[1, 1, 0, 0, 0], [1, 1, 1, 0, 1]]
    assert seen == whole_scene[:stop]
    assert len(drawn) == len(seen)
    assert [actor.GetVisibility() for actor in plotter.renderer.actors.values()] == [1, 1, 1, 0, 1]


@pytest.fixture
def session(square):
    found = open_mesh(StepFrame(square, quality(square)), None)
    found = changes.start_run(found)
    moved = square.with_points(square.points * [1.2, 1.0])
    found = changes.add_frames(found, [StepFrame(moved, quality(moved, square))])
    return changes.set_view(changes.end_run(found, "done"), color_by="size-skew")


def test_a_picture_in_pieces_is_the_one_that_is_drawn_at_once(session, square, monkeypatch):
    surfaces = find_surfaces(square)
    with OffscreenRenderer(session, surfaces) as renderer:
        at_once = renderer.image(PLAIN)
    monkeypatch.setattr(pieces.actor_groups, "__defaults__", (3,))
    with OffscreenRenderer(session, surfaces) as renderer:
        assert sum(1 for _ in renderer.prepare_steps()) > 10
        assert not list(renderer.prepare_steps()), "once"
        assert np.array_equal(run_to_end(renderer.render_steps(PLAIN)), at_once)
    with OffscreenRenderer(session, surfaces) as renderer:
        stopped = renderer.render_steps(PLAIN)
        for _ in range(5):
            next(stopped)
        stopped.close()
        assert np.array_equal(renderer.image(PLAIN), at_once), "the rest is done then"


def test_a_picture_is_drawn_once(session, square):
    with OffscreenRenderer(session, find_surfaces(square)) as renderer:
        renderer.image(PLAIN)
        drawn = []
        renderer._plotter.renderer.AddObserver("EndEvent", lambda *_: drawn.append(1))
        assert renderer.image(replace(PLAIN, size=(320, 240))).shape == (240, 320, 3)
        assert len(drawn) == 1


def test_another_step_is_pictured_and_the_session_stays(session, square):
    with OffscreenRenderer(session, find_surfaces(square)) as renderer:
        last = renderer.image(PLAIN)
        first = run_to_end(renderer.render_steps(PLAIN, frame=0))
        assert renderer.session is session
        assert not np.array_equal(first, last)
        assert np.array_equal(renderer.image(PLAIN), last)
    with OffscreenRenderer(changes.show_frame(session, 0), find_surfaces(square)) as renderer:
        assert np.array_equal(renderer.image(PLAIN), first)
