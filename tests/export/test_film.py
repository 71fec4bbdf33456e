import gc
import os
import re
import stat
import weakref
from contextlib import suppress
from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from slideviz.case.model import Case
from slideviz.color_scheme import PAPER
from slideviz.errors import SlidevizError
from slideviz.export import offscreen_renderer as renderer_module
from slideviz.export.film import (
    FilmOptions,
    check_film,
    draw_images,
    film,
    film_steps,
    image_options,
)
from slideviz.export.offscreen import font_scale, offscreen
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.scene import Scene
from slideviz.scene.stage import Stage
from slideviz.session.opening import session_of_runs
from slideviz.session.state import Run, StepFrame

SMALL = (320, 200)


def leaning(mesh, steps=3, by=0.9):
    """The mesh and steps that lean it to the right, ever further."""
    frames = [StepFrame(mesh, quality(mesh, reference=mesh))]
    for k in range(1, steps + 1):
        points = mesh.points.copy()
        points[:, 0] += by * k / steps * points[:, 1]
        moved = mesh.with_points(points)
        frames.append(StepFrame(moved, quality(moved, reference=mesh)))
    return tuple(frames)


def shoot(frames, file, film_options, **options):
    return [(d.done, d.total) for d in film(shown(frames), file, film_options, **options)]


def shown(frames):
    """A session of a run with these steps."""
    return session_of_runs(frames[0], [Run(1, Case(), tuple(frames[1:]), "done")])


def film_of(session, file, film_options, like=None):
    """Film what a view shows."""
    figure = replace(image_options(film_options.size), fill=like is None)
    with OffscreenRenderer(session, find_surfaces(session.mesh), like) as renderer:
        yield from draw_images(film_steps(renderer, figure, file, film_options))


def mp4_images(file):
    reader = imageio_ffmpeg.read_frames(str(file))
    meta = next(reader)
    width, height = meta["size"]
    return meta, [np.frombuffer(f, np.uint8).reshape(height, width, 3) for f in reader]


def gif_images(file):
    with Image.open(file) as image:
        found = []
        for k in range(image.n_frames):
            image.seek(k)
            found.append((image.info["duration"], np.asarray(image.convert("RGB"))))
        return image.info.get("loop"), found


def differ(a, b):
    return int((np.abs(a.astype(int) - b.astype(int)).max(axis=2) > 40).sum())


@pytest.fixture
def frames(square):
    return leaning(square)


@pytest.fixture
def ran(session, frames):
    run = Run(1, session.case, frames[1:], "done")
    view = replace(session.view, color_by="size-skew", frame=2)
    return replace(session, first=frames[0], runs=(run,), shown=1, view=view)


def test_an_mp4_has_the_size_the_time_and_the_steps(tmp_path, frames):
    file = tmp_path / "a.mp4"
    drawn = shoot(frames, file, FilmOptions(SMALL, fps=5, hold=1.0))
    assert drawn == [(1, 4), (2, 4), (3, 4), (4, 4)]
    meta, images = mp4_images(file)
    assert meta["size"] == SMALL
    assert meta["codec"] == "h264"
    assert "yuv420p" in meta["pix_fmt"]
    assert meta["fps"] == 10, "players stumble over fewer images per second"
    assert len(images) == 3 * 2 + 10
    assert meta["duration"] == pytest.approx(3 / 5 + 1.0, abs=0.01)
    assert differ(images[0], images[-1]) > 1000
    assert differ(images[0], images[1]) < 20, "the first is shown twice"
    assert differ(images[-1], images[7]) < 20, "the last one stays"
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_the_colors_of_an_mp4_are_those_of_the_picture(tmp_path, frames):
    shoot(frames, tmp_path / "a.mp4", FilmOptions(SMALL))
    shoot(frames, tmp_path / "a%d.png", FilmOptions(SMALL))
    image = mp4_images(tmp_path / "a.mp4")[1][-1]
    with Image.open(tmp_path / "a3.png") as picture:
        asked = np.asarray(picture)
    same = np.abs(image.astype(int) - asked.astype(int)).max(axis=2)
    assert np.median(same[90:150, 60:200]) <= 8, "cells"
    assert image[-2, 2].tolist() == pytest.approx([255, 255, 255], abs=4)


def test_a_gif_repeats_for_ever_with_the_times_asked_for(tmp_path, frames):
    file = tmp_path / "a.gif"
    shoot(frames, file, FilmOptions(SMALL, fps=30, hold=0.5))
    loop, found = gif_images(file)
    assert loop == 0
    assert [time for time, _ in found] == [30, 40, 30, 500], "hundredths, right in sum"
    assert {image.shape for _, image in found} == {(200, 320, 3)}
    assert differ(found[0][1], found[-1][1]) > 1000
    shoot(frames, tmp_path / "a%d.png", FilmOptions(SMALL))
    for k, (_, image) in enumerate(found):
        with Image.open(tmp_path / f"a{k}.png") as picture:
            away = np.abs(np.asarray(picture).astype(int) - image.astype(int)).max(axis=2)
        assert np.percentile(away, 99) < 32, f"image {k} from only its changes"


def test_a_gif_keeps_the_shades_of_the_color_map_and_rare_colors():
    from slideviz.export.encode import _palette

    sample = np.full((200, 320, 3), 255, np.uint8)
    sample[:, :256, 0] = np.arange(256)
    sample[:, :256, 1:] = 60
    sample[:6, 300:306] = [232, 17, 45]  # one inverted cell
    with_palette = Image.fromarray(sample).quantize(palette=_palette([sample] * 3), dither=0)
    image = np.asarray(with_palette.convert("RGB")).astype(int)
    assert len(np.unique(np.asarray(with_palette)[100, :256])) > 50
    assert np.abs(image - sample).max() <= 20
    assert np.abs(image[3, 303] - [232, 17, 45]).max() <= 10


def test_the_camera_sees_every_step_whole(tmp_path, square):
    frames = leaning(square, steps=2, by=3.0)
    for name, order in (("out", frames), ("back", frames[::-1])):
        shoot(order, tmp_path / f"{name}%d.png", FilmOptions(SMALL))
        for k in range(3):
            with Image.open(tmp_path / f"{name}{k}.png") as picture:
                drawn = np.asarray(picture)[20:, :240].min(axis=2) < 200
            assert drawn.any()
            assert not drawn[:, 0].any()
            assert not drawn[:, -1].any()
            assert not drawn[-1].any()


def test_steps_that_do_not_change_are_images_of_a_gif_too(tmp_path, frames):
    shoot((frames[0], frames[0], frames[0]), tmp_path / "a.gif", FilmOptions(SMALL, fps=10))
    assert len(gif_images(tmp_path / "a.gif")[1]) == 3


def test_few_images_are_shown_longer_and_many_ten_a_second():
    assert FilmOptions().pace(2) == 1.0
    assert FilmOptions().pace(7) == pytest.approx(7 / 3)
    assert FilmOptions().pace(100) == 10.0
    assert FilmOptions(between=9).pace(11) == 10.0
    assert FilmOptions(fps=25).pace(2) == 25


def test_images_in_between_have_their_own_mesh_and_quality(tmp_path, frames, monkeypatch):
    seen, words = [], []
    draw, write = OffscreenRenderer.draw_panes, renderer_module.write_title
    monkeypatch.setattr(
        OffscreenRenderer,
        "draw_panes",
        lambda self, shown, *rest: (seen.append(shown[0].frame), draw(self, shown, *rest))[1],
    )
    monkeypatch.setattr(
        renderer_module,
        "write_title",
        lambda p, text, *rest: (words.append(text), write(p, text, *rest)),
    )
    drawn = shoot(frames[:2], tmp_path / "s%d.png", FilmOptions(SMALL, between=1))
    assert drawn[-1] == (3, 3)
    half = seen[1]
    middle = (frames[0].mesh.points + frames[1].mesh.points) / 2
    assert np.allclose(half.mesh.points, middle, atol=1e-14)
    asked = quality(half.mesh, reference=frames[0].mesh)
    assert half.quality.values.tolist() == asked.values.tolist()
    assert words[0] == "undeformed: min 1.0000, mean 1.0000"
    assert words[1].startswith("step 0.50 of 1, interpolated: min 0.9")
    assert words[2].startswith("step 1 of 1: min 0.9")


def test_pictures_go_into_a_folder_that_is_made(tmp_path, frames):
    shoot(frames, tmp_path / "steps", FilmOptions(SMALL))
    names = sorted(path.name for path in (tmp_path / "steps").iterdir())
    assert names == ["step_00.png", "step_01.png", "step_02.png", "step_03.png"]
    with Image.open(tmp_path / "steps" / "step_03.png") as image:
        assert image.size == SMALL
    shoot(frames, tmp_path / "x_%03d.png", FilmOptions(SMALL))
    assert (tmp_path / "x_003.png").exists()


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a_%02d.png", "steps"])
def test_closing_it_early_leaves_nothing(tmp_path, frames, name):
    drawing = film(shown(frames), tmp_path / name, FilmOptions(SMALL))
    assert next(drawing).done == 1
    assert next(drawing).done == 2
    drawing.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a_00.png"])
def test_a_film_of_before_stays_until_the_new_one_is_done(tmp_path, frames, name):
    asked = tmp_path / name.replace("00", "%02d")
    (tmp_path / name).write_bytes(b"before")
    drawing = film(shown(frames), asked, FilmOptions(SMALL))
    with pytest.raises(SlidevizError, match=rf"{re.escape(name)} exists already; choose another"):
        next(drawing)
    drawing = film(shown(frames), asked, FilmOptions(SMALL), overwrite=True)
    next(drawing)
    drawing.close()
    assert (tmp_path / name).read_bytes() == b"before"
    shoot(frames, asked, FilmOptions(SMALL), overwrite=True)
    assert (tmp_path / name).stat().st_size > 1000


def test_what_fails_while_drawing_leaves_nothing(tmp_path, frames, square):
    broken = StepFrame(square.with_points(square.points), quality(square))
    object.__setattr__(broken, "quality", None)
    with pytest.raises(AttributeError):
        shoot((*frames[:2], broken, frames[2]), tmp_path / "a.mp4", FilmOptions(SMALL))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "film_options", "message"),
    [
        (
            "a.avi",
            FilmOptions(),
            r"no film can be written as \.avi; end the name with \.mp4 or \.gif",
        ),
        ("a.png", FilmOptions(), r"need one number in their name, such as step_%03d\.png"),
        ("a_%d_%d.png", FilmOptions(), r"need one number in their name"),
        ("a.mp4", FilmOptions((321, 200)), r"321x200 pixels .* must be even; take 322x200"),
        ("a.gif", FilmOptions((10, 200)), r"10x200 pixels cannot be drawn; .* are 64 to 8192"),
        (
            "a.gif",
            FilmOptions(fps=60),
            r"60 images per second cannot be shown; 0\.1 to 50 can \(\.gif\)",
        ),
        ("a.mp4", FilmOptions(fps=-1), r"-1 images per second cannot be shown"),
        ("a.mp4", FilmOptions(fps=float("nan")), r"nan images per second cannot be shown"),
        ("a.mp4", FilmOptions(hold=-1), r"cannot stay for -1 s; 0 to 600 s can"),
        ("a.mp4", FilmOptions(between=-1), r"-1 images between two steps; 0 to 1000 are possible"),
        ("no/a.mp4", FilmOptions(), r"the folder .*no does not exist; create it first"),
        ("no/steps", FilmOptions(), r"the folder .*no does not exist; create it first"),
    ],
)
def test_what_cannot_be_made_is_told_before_the_work(tmp_path, name, film_options, message):
    with pytest.raises(SlidevizError, match=message):
        check_film(tmp_path / name, film_options)


def test_a_file_in_the_place_of_a_folder_is_told(tmp_path):
    (tmp_path / "steps").write_text("")
    with pytest.raises(SlidevizError, match=r"steps is not a folder; end the name of a film with"):
        check_film(tmp_path / "steps", FilmOptions())


def test_a_folder_without_permission_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(SlidevizError, match="no permission to write there; choose another folder"):
        check_film(tmp_path / "a.mp4", FilmOptions())


def test_without_steps_there_is_no_film(tmp_path, frames):
    with pytest.raises(SlidevizError, match="there are no steps to make a film of; run the case"):
        next(film(shown(frames[:1]), tmp_path / "a.mp4"))


def test_an_encoder_that_fails_or_is_not_there_is_told(tmp_path, frames, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\necho 'No space left on device' >&2\nexit 1\n")
    program.chmod(stat.S_IRWXU)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    with pytest.raises(SlidevizError, match=r"a\.mp4: cannot be written: ffmpeg stopped: No space"):
        shoot(frames, tmp_path / "a.mp4", FilmOptions(SMALL))
    program.write_text("#!/bin/sh\ncat >/dev/null\nexit 1\n")
    with pytest.raises(SlidevizError, match=r"ffmpeg stopped: it gave no reason"):
        shoot(frames, tmp_path / "a.mp4", FilmOptions(SMALL))
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "none"))
    with pytest.raises(SlidevizError, match=r"ffmpeg, which makes MP4 films, cannot be started"):
        shoot(frames, tmp_path / "a.mp4", FilmOptions(SMALL))
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_pictures_that_cannot_be_written_are_told(tmp_path, frames, monkeypatch):
    from pathlib import Path

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(SlidevizError, match="steps: cannot be written: No space left on device"):
        shoot(frames, tmp_path / "steps", FilmOptions(SMALL))
    assert not list(tmp_path.iterdir())


def test_the_view_is_filmed_with_its_camera_and_one_color_range(tmp_path, ran):
    mesh = ran.mesh
    surfaces = find_surfaces(mesh)
    with offscreen(SMALL) as plotter:
        like = Scene(plotter, PAPER)
        like.stage.font_scale = font_scale(SMALL)
        like.open(ran, surfaces)
        plotter.camera.parallel_scale *= 3.0
        drawing = film_of(ran, tmp_path / "v%d.png", FilmOptions(SMALL), like=like)
        assert [drawn.done for drawn in drawing] == [1, 2, 3, 4]
    whole = [d.done for d in film_of(ran, tmp_path / "w%d.png", FilmOptions(SMALL))]
    assert whole == [1, 2, 3, 4]

    def covered(name):
        with Image.open(tmp_path / name) as image:
            return int((np.asarray(image.convert("RGB"))[30:, :240].min(axis=2) < 160).sum())

    assert covered("v0.png") < covered("w0.png") / 4, "from as far away as the view"
    with Image.open(tmp_path / "w0.png") as first, Image.open(tmp_path / "w3.png") as last:
        assert differ(np.asarray(first.convert("RGB")), np.asarray(last.convert("RGB"))) > 1000


def test_displacement_of_the_view_keeps_the_range_of_the_last_step(tmp_path, ran, monkeypatch):
    ran = replace(ran, view=replace(ran.view, color_by="displacement"))
    seen = []
    draw = OffscreenRenderer.draw_panes

    def watch(self, shown, *rest):
        seen.extend((one.color_range, one.frame) for one in shown)
        return draw(self, shown, *rest)

    monkeypatch.setattr(OffscreenRenderer, "draw_panes", watch)
    for _ in film_of(ran, tmp_path / "v%d.png", FilmOptions(SMALL)):
        pass
    assert {span for span, _ in seen} == {ran.color_range}
    assert [frame for _, frame in seen] == list(ran.frames)


def test_cancelling_the_film_of_a_view_leaves_nothing(tmp_path, ran):
    drawing = film_of(ran, tmp_path / "v.mp4", FilmOptions(SMALL))
    next(drawing)
    with suppress(KeyboardInterrupt):
        drawing.throw(KeyboardInterrupt())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("count", [1, 2])
def test_a_film_draws_its_mesh_once_and_leaves_nothing(tmp_path, square, monkeypatch, count):
    added, scenes = [], []
    add, draw = Stage.add, OffscreenRenderer.draw_panes
    monkeypatch.setattr(
        Stage, "add", lambda self, *rest, **more: (added.append(1), add(self, *rest, **more))[1]
    )

    def watch(self, *rest):
        scenes.append(weakref.ref(self._scene))
        added_before.append(len(added))
        return draw(self, *rest)

    added_before = []
    monkeypatch.setattr(OffscreenRenderer, "draw_panes", watch)
    frames = leaning(square)
    runs = [Run(k, Case(), frames[1:], "done", name=str(k)) for k in range(1, count + 1)]
    for _ in film(session_of_runs(frames[0], runs), tmp_path / "a%d.png", FilmOptions((640, 300))):
        pass
    assert len(scenes) == 4
    assert {len(added), *added_before} == {len(added)}, "no actor is made again"
    gc.collect()
    assert all(scene() is None for scene in scenes)
