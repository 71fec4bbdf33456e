"""The pictures of ``make shots``: each state, as the screen shows it."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from slideviz.errors import SlidevizError
from tools import shots


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(shots, "STATOR_CELLS", 6_000)


@pytest.fixture
def window(qapp, tmp_path):
    with shots.open_window(tmp_path) as opened:
        yield opened


@pytest.mark.slow
def test_roles_are_guesses_and_the_menu_is_in_the_picture(window, tmp_path):
    shots.roles(window, tmp_path)
    session = window.store.session
    assert session.role("BLADE") == "moving"
    assert "BLADE" not in session.guesses
    assert session.role("INFLOW") == "sliding"
    assert "INFLOW" in session.guesses
    assert window.run_panel.run.isEnabled()
    path = shots.photograph(window, tmp_path / "roles.png")
    with Image.open(path) as image:
        assert image.size == shots.SIZE
        shown = np.asarray(image.convert("RGB")).astype(int)
    drawn = window.grab().toImage().convertToFormat(window.grab().toImage().Format.Format_RGB888)
    rows = np.frombuffer(drawn.constBits(), np.uint8).reshape(drawn.height(), -1)
    plain = rows[:, : 3 * drawn.width()].reshape(drawn.height(), drawn.width(), 3)
    # The menu is a window of its own: only the screen has it.
    assert (np.abs(shown - plain).max(axis=2) > 40).sum() > 3_000


@pytest.mark.slow
def test_quality_shows_the_last_step_with_neighbours(window, tmp_path):
    shots.quality(window, tmp_path)
    session = window.store.session
    assert session.run_shown.end == "done"
    assert session.view.frame == 5
    assert session.frame.quality.inverted == 0
    assert session.view.passages == 1
    assert session.view.color_by == "size-skew"


@pytest.mark.slow
def test_span_is_near_the_tip_beside_the_throat(window, tmp_path):
    shots.span(window, tmp_path)
    (cut,) = window.store.session.view.sections
    assert (cut.kind, cut.span, cut.flat) == ("span", 0.9, True)
    [axes] = window.dock_manager.panel(shots.CurvesPanel).canvas.figure.axes
    assert axes.get_xlabel() == "throat [mesh units]"


@pytest.mark.slow
def test_section_is_a_cylinder_that_is_unrolled(window, tmp_path):
    shots.section(window, tmp_path)
    (cut,) = window.store.session.view.sections
    assert cut.kind == "cylinder"
    assert cut.radius == pytest.approx(0.275, abs=5e-3)  # within a cell of mid-span
    assert window.section_views.flat is not None
    assert window.section_views.flat.isVisible()


@pytest.mark.slow
def test_side_by_side_shows_what_sliding_is_good_for(window, tmp_path):
    shots.beside(window, tmp_path)
    session = window.store.session
    held, slid = (run.last.quality for run in session.runs)
    assert session.shown == 2
    assert session.view.beside == 1
    assert held.inverted > 0 == slid.inverted
    assert window.viewing.second.isVisible()


@pytest.mark.slow  # `test_window` has what themes change
def test_dark_is_dark(window, tmp_path):
    shots.dark(window, tmp_path)
    with Image.open(shots.photograph(window, tmp_path / "dark.png")) as image:
        assert np.asarray(image.convert("L")).mean() < 90


def film_of_nothing(_window, path, _place):
    path.touch()
    return path


@pytest.mark.slow
def test_all_pictures_of_a_folder_and_the_film_moves(tmp_path, qapp, monkeypatch):
    start = shots.ShotState("start", lambda window, place: None)
    monkeypatch.setattr(shots, "STATES", (start,))
    monkeypatch.setattr(shots, "machine_pictures", lambda folder, place: [])
    monkeypatch.setattr(shots, "film_of_window", film_of_nothing)
    start, window, *paths = shots.shots(tmp_path / "new" / "folder")
    assert (start.name, window.name) == ("start.png", "window.gif")
    assert [path.name for path in paths] == ["passage.gif", "in_time.gif"]
    paths = [start, *paths]
    assert all(path.stat().st_size > 1_000 for path in paths)
    with Image.open(paths[1]) as film:
        first = np.asarray(film.convert("L")).astype(int)
        film.seek(film.n_frames - 1)
        last = np.asarray(film.convert("L")).astype(int)
    assert film.n_frames == 11
    assert (np.abs(first - last) > 60).mean() > 0.02
    assert paths[1].stat().st_size < 500_000


def test_a_palette_keeps_a_few_red_pixels_and_a_smooth_background(tmp_path):
    across = np.linspace(200, 250, 400).astype(np.uint8)
    drawn = np.repeat(np.repeat(across[None, :, None], 300, axis=0), 3, axis=2)
    noise = np.random.default_rng(0).integers(0, 255, (60, 60, 3))
    drawn[100:160, 100:160] = noise
    drawn[250:] = 255
    drawn[10:13, 10:13] = (232, 17, 45)
    path = tmp_path / "drawn.png"
    Image.fromarray(drawn).save(path)
    shots.shrink(path)
    with Image.open(path) as image:
        assert image.mode == "P"
        kept = np.asarray(image.convert("RGB")).astype(int)
    assert np.abs(kept[11, 11] - (232, 17, 45)).max() < 30
    assert np.abs(kept[200:] - drawn[200:]).max() <= 4
    assert (kept[250:] == 255).all()


@pytest.mark.slow
def test_the_film_shows_a_blade_dragged_with_its_preview(window, tmp_path, monkeypatch):
    monkeypatch.setattr(shots, "TURNS", 4)
    monkeypatch.setattr(shots, "LIFTS", 3)
    path = shots.film_of_window(window, tmp_path / "film.gif", tmp_path)
    session = window.store.session
    turned, lifted = session.case.motions
    assert turned.angle_deg == pytest.approx(shots.TURN, abs=0.3)
    assert lifted.vector == pytest.approx((0.0, shots.LIFT), abs=0.01)
    assert not session.outdated, "the run has taken the place of the preview"
    with Image.open(path) as film:
        assert film.size == shots.WINDOW_FILM
        assert film.n_frames >= 7, "what is dragged moves in each picture"
        pictures = []
        for k in range(film.n_frames):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB"))[60:560, 280:700].astype(int))
    for after in pictures[2:]:
        assert (np.abs(after - pictures[0]).max(axis=2) > 40).sum() > 500


def test_the_film_in_the_repository_takes_ten_seconds_and_three_megabytes():
    path = Path(shots.__file__).parents[1] / "screenshots" / "window.gif"
    assert path.stat().st_size < 3e6
    with Image.open(path) as film:
        times = []
        for k in range(film.n_frames):
            film.seek(k)
            times.append(film.info["duration"])
    assert 9_000 < sum(times) < 11_000


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SlidevizError, match="cannot create this folder"):
        shots.shots(tmp_path / "file" / "folder")


def test_a_picture_that_cannot_be_written(window, tmp_path):
    with pytest.raises(SlidevizError, match="the picture cannot be written; choose another folder"):
        shots.photograph(window, tmp_path / "none" / "picture.png")


def test_what_never_gets_ready(qapp, monkeypatch):
    monkeypatch.setattr(shots, "PATIENCE", 0.05)
    with pytest.raises(SlidevizError, match="the window did not get ready within 0 s"):
        shots.wait(lambda: False)


def test_no_display_and_no_xvfb(monkeypatch):
    from qtpy.QtWidgets import QApplication

    monkeypatch.setattr(QApplication, "instance", lambda: None)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with (
        pytest.raises(SlidevizError, match="there is no display and no Xvfb"),
        shots.display(),
    ):
        pass
