"""Pictures, films, tables and meshes leave the window; dialogs show what will be written."""

import csv
import json
import shlex
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from qtpy.QtCore import Qt, QTimer, QUrl
from qtpy.QtGui import QShortcut
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QDialog

from slideviz import read
from slideviz.case.model import Case
from slideviz.cli import run
from slideviz.errors import SlidevizError
from slideviz.export import film as film_module
from slideviz.export.film import FilmOptions
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.gui.dialogs import help as manual
from slideviz.gui.dialogs import pictures
from slideviz.gui.dialogs.pictures import (
    FilmDialog,
    FilmForm,
    PictureDialog,
    fitted,
    framed,
    length_words,
    to_image,
)
from slideviz.gui.panels.boundaries import BoundariesPanel
from slideviz.gui.widgets import questions
from slideviz.mesh.quality import quality
from slideviz.plots.session_plots import draw_meridional_view, gaps_of
from slideviz.plots.style import PRINT
from slideviz.session import changes, jobs, pieces
from slideviz.session.section_cuts import first_section
from tests.builders import passage, stage
from tests.golden.alike import picture_difference
from tests.mesh.test_interfaces import moved, zones
from tests.test_cli_report import read_report

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def opened(driver, passage_file):
    driver.open(passage_file)
    return driver


@pytest.fixture
def ran(with_runs):
    return with_runs({"steps": 2})


@pytest.fixture
def renderer(opened):
    viewing = opened.window.viewing
    with OffscreenRenderer(opened.session, viewing.surfaces, viewing.scene) as made:
        yield made


def in_dialog(do):
    """Do something with the next dialog, then close it as ``do`` says: True accepts."""

    def reach():
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, QDialog):
            QTimer.singleShot(20, reach)
            return
        accepts = False
        try:
            accepts = do(dialog)
        finally:  # a test that fails must not wait for its dialog
            (dialog.accept if accepts else dialog.reject)()

    QTimer.singleShot(20, reach)


def wait_for_another(qtbot, dialog, before):
    """Wait until a dialog's preview differs from an image; a failure says how far it came."""

    def redrawn():
        state = (dialog.soon.isActive(), dialog.drawer.busy, dialog.isVisible())
        again = dialog.picture.pixmap().toImage()
        assert again != before, f"(to be drawn, drawing, visible): {state}; {again.size()}"

    qtbot.waitUntil(redrawn)


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("RGBA")), image.info


# Picture -----------------------------------------------------------------------------------


@pytest.mark.window("own")
def test_the_usual_picture_is_white_without_clutter(opened, answers, tmp_path):
    asked = answers("ask_save", tmp_path / "out.png")
    opened.window.set_theme("dark")
    in_dialog(lambda _: True)
    opened.window.actions_table.by_name["save_picture"].trigger()
    found, _ = pixels(tmp_path / "out.png")
    assert found.shape[:2] == (1000, 1600)
    assert (found[[0, 0, -1, -1], [0, -1, 0, -1]] == 255).all()
    assert len(np.unique(found[::4, ::4].reshape(-1, 4), axis=0)) > 50
    assert "PNG" in asked[0][2]
    assert "SVG" in asked[0][2]


def test_a_cancelled_picture_asks_for_no_name_and_one_that_cannot_be_written_is_told(
    opened, answers, tmp_path
):
    in_dialog(lambda _: False)
    opened.window.exports.picture()
    answers("ask_save", tmp_path / "no" / "out.png")
    in_dialog(lambda _: True)
    opened.window.exports.picture()
    assert "folder does not exist" in opened.window.banner.text.text()


def test_the_preview_follows_the_options(renderer, qtbot):
    dialog = PictureDialog(None, renderer)
    qtbot.addWidget(dialog)
    dialog.show()
    qtbot.waitUntil(lambda: not dialog.picture.pixmap().isNull())
    white = dialog.picture.pixmap().toImage()
    assert white.width() <= dialog.picture.width()
    dialog.background.show_value("transparent")
    dialog.background.chosen.emit("transparent")
    wait_for_another(qtbot, dialog, white)
    assert dialog.picture_options.background == "transparent"
    dialog.reject()


def test_sizes_in_pixels_and_on_paper_are_offered_again_and_broken_ones_are_not(renderer, qtbot):
    dialog = PictureDialog(None, renderer, (900, 700))
    qtbot.addWidget(dialog)
    for name, size in (("1920x1080", (1920, 1080)), ("view", (900, 700))):
        dialog.size_choice.show_value(name)
        dialog.size_choice.chosen.emit(name)
        assert dialog.picture_options.size == size
    dialog.width_px.setValue(777)
    assert dialog.size_choice.currentData() == "other"
    dialog.size_choice.show_value("paper")
    dialog.size_choice.chosen.emit("paper")
    dialog.width_cm.setValue(8.0)
    dialog.height_cm.setValue(5.0)
    figure = dialog.picture_options
    assert figure.size == (945, 591)
    assert figure.dpi == 300
    # Letters of 8.5 points.
    assert 13.0 * figure.scale == pytest.approx(8.5 / 72 * 300)
    assert "8.0 × 5.0 cm" in dialog.words.text()
    dialog.width_cm.setValue(100.0)
    assert not dialog.save.isEnabled()
    assert "8192" in dialog.words.text()
    dialog = PictureDialog(None, renderer)
    qtbot.addWidget(dialog)
    dialog.options["title"].setChecked(True)
    dialog.width_px.setValue(700)
    again = PictureDialog(None, renderer, kept=dialog.choices)
    qtbot.addWidget(again)
    assert again.picture_options.title
    assert again.picture_options.size == dialog.picture_options.size
    assert again.size_choice.currentData() == "other"
    for broken in ("{", "[1]", json.dumps({"size": "x"}), json.dumps({"paper": [1]})):
        usual = PictureDialog(None, renderer, kept=broken)
        qtbot.addWidget(usual)
        assert usual.picture_options.background == "white"
    from slideviz.export.vector import require_vector

    with pytest.raises(SlidevizError, match="end the name with one of these"):
        require_vector(renderer.session, Path("a.png"))


@pytest.mark.window("own")
def test_a_picture_for_paper_knows_its_size(opened, answers, tmp_path):
    answers("ask_save", tmp_path / "out.png")

    def choose(dialog):
        dialog.size_choice.show_value("paper")
        dialog.size_choice.chosen.emit("paper")
        return True

    in_dialog(choose)
    opened.window.exports.picture()
    _, known = pixels(tmp_path / "out.png")
    assert known["dpi"] == pytest.approx((300, 300), abs=0.1)


@pytest.mark.window("own")
def test_copy_in_the_dialog_and_by_keys(opened, qtbot):
    clipboard = QApplication.clipboard()
    clipboard.clear()
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    opened.window.set_theme("dark")
    opened.activate()
    QTest.keyClick(opened.window, Qt.Key.Key_C, keys)
    image = clipboard.image()
    assert image.width() >= 1600
    assert image.pixelColor(0, 0).name() == "#ffffff"
    clipboard.clear()

    def copy(dialog):
        dialog.copy.click()
        return False

    in_dialog(copy)
    opened.window.exports.picture()
    assert clipboard.image().width() == 1600


@pytest.mark.window("own")
def test_drawings_of_2d_meshes(ran, answers, tmp_path):
    def saved(name):
        answers("ask_save", tmp_path / name)
        in_dialog(lambda _: True)
        ran.window.exports.picture()
        return (tmp_path / name).read_bytes()

    assert saved("out.pdf").startswith(b"%PDF")
    drawn = saved("out.svg")
    assert drawn.startswith(b"<?xml")
    assert drawn.count(b"<path") >= len(ran.session.mesh.cells), "a path for every cell"


@pytest.mark.window("own")
def test_3d_meshes_have_no_drawings(driver, sample_folder, qtbot):
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    assert pictures.picture_filters(driver.session)[0] == questions.PICTURE_FILTERS
    viewing = driver.window.viewing
    with OffscreenRenderer(driver.session, viewing.surfaces, viewing.scene) as renderer:
        dialog = PictureDialog(None, renderer)
        qtbot.addWidget(dialog)
        assert "3D" in dialog.kinds.text()
        dialog.reject()


@pytest.mark.window("own")
def test_two_runs_beside_each_other_are_one_picture(ran):
    ran.window.start_run()
    ran.settle()
    ran.window.store.change(changes.show_beside, 1)
    viewing = ran.window.viewing
    with OffscreenRenderer(ran.session, viewing.surfaces, viewing.scene) as renderer:
        both = renderer.image(PictureOptions((800, 400), legend=False))
        one = renderer.image(PictureOptions((800, 400), legend=False, both=False))
        dialog = PictureDialog(None, renderer)
        assert not dialog.options["both"].isHidden()
        dialog.reject()
    drawn = (both < 250).any(axis=2).any(axis=0)
    assert drawn[:390].any()
    assert drawn[410:].any()
    assert drawn[396:404].sum() == 1, "only the line between them"
    assert (one < 250).any(axis=2).any(axis=0)[396:404].any()


def test_pictures_become_qt_images_as_they_are():
    image = np.zeros((3, 5, 3), np.uint8)
    image[1, 2] = 10, 20, 30
    assert to_image(image).pixelColor(2, 1).getRgb()[:3] == (10, 20, 30)
    clear = to_image(np.zeros((3, 5, 4), np.uint8))
    assert clear.pixelColor(0, 0).alpha() == 0
    assert framed(clear).toImage().pixelColor(2, 2).alpha() == 255
    assert fitted(to_image(image), (10, 10)).width() == 10


# Film --------------------------------------------------------------------------------------


@pytest.fixture
def film(ran):
    ran.window.exports.make_film()
    dialog = ran.window.exports.film
    dialog.form.between.setValue(0)
    dialog.form.width_px.setValue(320)
    dialog.form.height_px.setValue(200)
    return dialog


def test_a_film_needs_steps_and_the_menu_says_so(opened):
    act = opened.window.actions_table.by_name["export_film"]
    assert not act.isEnabled()
    assert "run the case first" in act.statusTip()
    opened.window.exports.make_film()
    assert opened.window.exports.film is None


def test_a_film_is_made_while_the_window_goes_on(ran, film, answers, tmp_path, qtbot):
    answers("ask_save", tmp_path / "out.gif")
    film.form.kind.show_value(".gif")
    film.form._kind_chosen(".gif")
    film.form.width_px.setValue(320)
    film.form.height_px.setValue(200)
    turns = []
    timer = QTimer()
    timer.timeout.connect(lambda: turns.append(film.bar.value()))
    timer.start(0)
    with qtbot.waitSignal(film.made):
        film.make.click()
        assert film.filming
        ran.window.store.change(changes.show_frame, 1)
    timer.stop()
    with Image.open(tmp_path / "out.gif") as image:
        assert image.size == (320, 200)
        assert image.n_frames == 3
    assert {1, 2} <= set(turns)
    assert ran.window.exports.film is None
    assert ran.session.view.frame == 1


@pytest.mark.usefixtures("painted")
def test_a_film_of_two_runs_has_both_side_by_side(with_runs, answers, tmp_path, qtbot):
    driver = with_runs({"steps": 3}, {"steps": 1})
    window = driver.window
    window.store.change(changes.show_beside, 1)
    window.exports.make_film()
    film = window.exports.film
    assert film.form.both.isVisibleTo(film)
    assert film.form.frames == 2
    film.form.both.setChecked(True)
    assert film.form.frames == 4, "of the run with more steps"
    film.form.kind.show_value(".gif")
    film.form._kind_chosen(".gif")
    film.form.width_px.setValue(200)
    film.form.height_px.setValue(200)
    film.form.both.setChecked(True)
    assert "too narrow for two runs" in film.words.text()
    film.form.width_px.setValue(480)
    film.form.between.setValue(0)
    answers("ask_save", tmp_path / "pair.gif")
    with qtbot.waitSignal(film.made):
        film.make.click()
    with Image.open(tmp_path / "pair.gif") as image:
        assert image.size == (480, 200)
        assert image.n_frames == 4
    window.store.change(changes.show_beside, changes.UNDEFORMED)
    window.exports.make_film()
    assert not window.exports.film.form.both.isVisibleTo(window.exports.film)
    window.exports.film.reject()


def test_pictures_of_a_film_get_a_new_folder(ran, film, answers, tmp_path, qtbot):
    (tmp_path / "passage_steps").mkdir()
    answers("ask_folder", tmp_path)
    film.form.kind.show_value("")
    film.form._kind_chosen("")
    assert not film.form.fps.isEnabled()
    with qtbot.waitSignal(film.made):
        film.make.click()
    assert len(list((tmp_path / "passage_steps_2").glob("*.png"))) == 3
    assert not list((tmp_path / "passage_steps").iterdir())


def test_a_stopped_film_leaves_no_file(ran, film, answers, tmp_path, qtbot):
    answers("ask_save", tmp_path / "out.gif")
    film.form.kind.show_value(".gif")
    film.form.between.setValue(20)
    film.make.click()
    qtbot.waitUntil(lambda: film.bar.value() >= 2)
    with qtbot.waitSignal(film.stopped):
        film.stop.click()
    assert not list(tmp_path.glob("*.gif"))
    assert not list(tmp_path.glob(".*"))
    assert film.make.isEnabled()
    assert film.isVisible()


@pytest.mark.window("own")
@pytest.mark.parametrize("how", ["open", "close"])
def test_opening_or_closing_stops_a_film(ran, film, answers, tmp_path, passage_file, qtbot, how):
    answers("ask_unsaved", "discard")
    answers("ask_save", tmp_path / "out.gif")
    film.form.kind.show_value(".gif")
    film.form.between.setValue(20)
    film.make.click()
    qtbot.waitUntil(lambda: film.bar.value() >= 1)
    if how == "open":
        ran.open(passage_file)
    else:
        ran.window.close()
    assert ran.window.exports.film is None
    assert not list(tmp_path.glob("*.gif"))


def test_a_film_that_fails_is_told_and_with_an_error_nobody_expected_not_finished(
    ran, film, answers, tmp_path, qtbot, monkeypatch
):
    answers("ask_save", tmp_path / "no" / "out.gif")
    film.form.kind.show_value(".gif")
    with qtbot.waitSignal(film.failed):
        film.make.click()
    assert "folder" in ran.window.banner.text.text()
    assert not film.filming
    ran.window.banner.hide()
    answers("ask_save", tmp_path / "out.gif")
    film.form.kind.show_value(".gif")
    made = []
    film.made.connect(made.append)
    monkeypatch.setattr(film_module, "film_frame_at", None)
    with qtbot.waitSignal(film.failed):
        film.make.click()
    qtbot.wait(50)
    assert not made
    assert not film.filming
    assert ran.window.banner.isVisible()


def test_what_cannot_be_filmed_is_said_and_first_and_last_image_are_previewed(film, qtbot, ran):
    film.form.kind.show_value(".mp4")
    film.form.width_px.setValue(321)
    assert "even" in film.words.text()
    assert not film.make.isEnabled()
    film.form.width_px.setValue(320)
    assert film.make.isEnabled()
    assert film.words.text().startswith("3 images: the undeformed mesh and 2 steps")
    qtbot.waitUntil(lambda: all(not one.pixmap().isNull() for one in film.previews))
    first, last = (one.pixmap().toImage() for one in film.previews)
    assert first != last
    ran.window.exports.make_film()
    assert ran.window.exports.film is film
    assert len(ran.window.findChildren(FilmDialog)) == 1


def test_the_length_of_a_film_in_words():
    assert length_words(FilmOptions(fps=10.0, hold=1.5), 3, ".gif").endswith("lasts 1.7 s.")
    assert "4 images between two" in length_words(FilmOptions(fps=10.0, between=4), 3, ".mp4")
    assert length_words(FilmOptions(), 2, "").endswith("a file of its own.")


def test_images_in_between_are_measured_and_written_beside_the_window(
    ran, film, answers, tmp_path, monkeypatch, qtbot
):
    threads = {"measured": set(), "written": set()}
    measure, write = film_module.quality, film_module.writer

    def spy_quality(*values, **named):
        threads["measured"].add(threading.current_thread())
        return measure(*values, **named)

    @contextmanager
    def spy_writer(*values):
        with write(*values) as add:

            def spy_add(*image):
                threads["written"].add(threading.current_thread())
                add(*image)

            yield spy_add

    monkeypatch.setattr(film_module, "quality", spy_quality)
    monkeypatch.setattr(film_module, "writer", spy_writer)
    answers("ask_save", tmp_path / "out.gif")
    film.form.kind.show_value(".gif")
    film.form.between.setValue(1)
    with qtbot.waitSignal(film.made):
        film.make.click()
    for where in threads.values():
        assert where
        assert threading.main_thread() not in where


@pytest.mark.window("own")
def test_a_preview_appears_in_pieces(opened, qtbot, monkeypatch):
    monkeypatch.setattr(pieces.actor_groups, "__defaults__", (100,))
    ticks = []
    timer = QTimer()
    timer.timeout.connect(lambda: ticks.append(1))

    def look(dialog):
        timer.start(0)
        qtbot.waitUntil(lambda: not dialog.picture.pixmap().isNull())
        timer.stop()
        assert len(ticks) > 15, "the event loop went on"
        before = dialog.picture.pixmap().toImage()
        dialog.options["title"].toggle()
        wait_for_another(qtbot, dialog, before)
        return False

    in_dialog(look)
    opened.window.actions_table.by_name["save_picture"].trigger()
    assert ticks


@pytest.mark.window("own")
def test_a_copy_while_the_preview_is_drawn_is_whole_and_so_is_the_preview(opened, qtbot):
    pictures = []

    def look(dialog):
        qtbot.waitUntil(lambda: dialog.drawer.busy)
        dialog._copy()
        pictures.append(QApplication.clipboard().image().size())
        assert dialog.picture.pixmap().isNull()
        qtbot.waitUntil(lambda: not dialog.picture.pixmap().isNull())
        pictures.append(dialog.picture_options.size)
        return False

    in_dialog(look)
    opened.window.actions_table.by_name["save_picture"].trigger()
    copied, chosen = pictures
    assert (copied.width(), copied.height()) == tuple(chosen)


# Tables and meshes -------------------------------------------------------------------------


def test_quality_of_the_step_that_is_shown_as_csv(ran, answers, tmp_path):
    path = tmp_path / "q.csv"
    answers("ask_save", path)
    ran.window.store.change(changes.show_frame, 1)
    ran.window.actions_table.by_name["export_quality"].trigger()
    ran.settle()
    rows = list(csv.DictReader(path.read_text().splitlines()))
    frame = ran.session.frames[1]
    mesh = frame.mesh
    assert list(rows[0]) == ["cell", "type", "size", "skew", "size_skew", "status", "x", "y"]
    assert [int(row["cell"]) for row in rows] == list(range(len(mesh.cells)))
    assert [float(row["size_skew"]) for row in rows] == frame.quality.values.tolist()
    assert {row["type"] for row in rows} == {"quadrilateral"}
    assert {row["status"] for row in rows} == {"valid"}
    cells = mesh.cells
    first = mesh.points[cells.connectivity[: cells.offsets[1]]].mean(axis=0)
    assert np.allclose([float(rows[0]["x"]), float(rows[0]["y"])], first)


def test_a_cancelled_table_leaves_no_file(computed, tmp_path):
    from slideviz.errors import Cancelled

    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.save_quality(
            tmp_path / "q.csv", computed[0].session.first, jobs.Job(stopped=lambda: True)
        )
    assert not list(tmp_path.glob("q*"))


def test_all_steps_are_saved_with_numbers(ran, answers, tmp_path):
    answers("ask_numbered", tmp_path / "s.su2")
    assert ran.session.unsaved_mesh
    ran.window.actions_table.by_name["export_steps"].trigger()
    ran.settle()
    assert sorted(path.name for path in tmp_path.glob("s_*")) == ["s_1.su2", "s_2.su2"]
    assert np.array_equal(read(tmp_path / "s_2.su2").points, ran.session.frames[2].mesh.points)
    assert not ran.session.unsaved_mesh


def test_the_shown_step_is_saved_as_a_wheel_with_a_picture(driver, answers, tmp_path):
    mesh, roles = passage((2, 6, 6), 40.0), {"blade": "moving", "per1": "periodic"}
    case = Case(roles=roles | {"per2": "periodic"}, periodic_type="rotational")
    path = tmp_path / "ring.su2"
    driver.window.show_opened(jobs.prepare(mesh, path, case, jobs.Job()))
    act, shown = driver.window.actions_table.by_name["save_wheel"], []

    def look(dialog):
        shown.append(dialog.passages.itemText(dialog.passages.count() - 1))
        dialog.numbered.setChecked(len(shown) > 1)
        dialog.passages.setCurrentIndex(dialog.passages.count() - 1)
        driver.qtbot.waitUntil(lambda: not dialog.drawer.busy)
        assert not dialog.picture.pixmap().isNull()
        return True

    for passages, name in ((0, "wheel.su2"), (1, "part.su2b")):
        driver.window.store.change(changes.set_view, passages=passages)
        answers("ask_save", tmp_path / name)
        in_dialog(look)
        act.trigger()
        driver.settle()
    assert shown == ["the whole wheel, 9", "the passages in the view, 3"]
    whole, part = read(tmp_path / "wheel.su2"), read(tmp_path / "part.su2b")
    assert (len(whole.cells), len(part.cells)) == (9 * len(mesh.cells), 3 * len(mesh.cells))
    assert "per1" not in whole.marker_names
    assert {"blade_1", "blade_3", "per1"} <= set(part.marker_names)
    assert "3 passages" in driver.window.statusBar().currentMessage()
    in_dialog(lambda _: False)  # nothing is asked or written afterwards
    act.trigger()
    driver.window.store.change(changes.set_role, ["per1"], "fixed")
    assert not act.isEnabled()
    assert "must be periodic, by a whole part of a turn" in " ".join(act.toolTip().split())


@pytest.mark.window("own")
def test_a_stage_has_wheels_gaps_and_spans_of_its_zones(driver, answers, tmp_path):
    mesh, window = stage(), driver.window
    names = [f"{zone}:{side}" for zone in (1, 2) for side in ("per1", "per2")]
    roles = dict.fromkeys(names, "periodic") | {"1:blade": "moving", "2:blade": "moving"}
    case, path = Case(roles=roles, periodic_type="rotational"), tmp_path / "stage.su2"
    window.show_opened(jobs.prepare(mesh, path, case, jobs.Job()))
    words = []

    def look(dialog):
        words.extend((dialog.passages.currentText(), dialog.words.text()))
        driver.qtbot.waitUntil(lambda: not dialog.drawer.busy)
        dialog.picture.pixmap().save(str(tmp_path / "preview.png"))
        return True

    answers("ask_save", tmp_path / "wheel.su2")
    in_dialog(look)
    window.actions_table.by_name["save_wheel"].trigger()
    driver.settle()
    assert words[0] == "the whole wheel, 9 and 12"
    shown = np.asarray(Image.open(tmp_path / "preview.png").convert("L"), float)
    assert (shown < 250).mean() > 0.2  # two rings, not a passage of each
    assert words[1].startswith(f"{21 * len(mesh.parts[0].mesh.cells):,} cells")
    assert len(read(tmp_path / "wheel.su2").cells) == 21 * len(mesh.parts[0].mesh.cells)
    section = first_section("span", window.store.session)
    assert section.describe() == "50 % span from 1:hub to 1:shroud, 2:hub to 2:shroud"
    [(_, _, gaps)] = gaps_of(window.store.session)
    assert [gap.words for gap in gaps] == [f"zone {k}: throat of {k}:blade" for k in (1, 2)]
    figure = Figure()
    draw_meridional_view(window.store.session, figure, PRINT)
    assert [text.get_text() for text in figure.axes[0].texts] == [
        *("1:hub", "1:shroud"),
        *("2:hub", "2:shroud"),
    ]


def test_steps_that_exist_are_asked_about(ran, answers, tmp_path):
    (tmp_path / "s_1.su2").write_text("mine")
    answers("ask_numbered", tmp_path / "s.su2")
    for sure in (False, True):
        asked = answers("ask_replace", sure)
        ran.window.exports.steps()
        ran.settle()
        assert asked == [([tmp_path / "s_1.su2"],)]
        assert ((tmp_path / "s_1.su2").read_text() == "mine") is not sure


@pytest.fixture
def steps(computed):
    """The two steps of the run of `ran`, without a window."""
    opened, frames = computed
    return frames(opened.session.case.change(steps=2))


def test_cancelled_steps_keep_whole_files(steps, tmp_path):
    from slideviz.errors import Cancelled

    said = []
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.save_steps(tmp_path / "s.su2", steps, jobs.Job(said.append, lambda: len(said) > 0))
    assert [path.name for path in tmp_path.glob("s_*")] in ([], ["s_1.su2"])


@pytest.mark.parametrize(
    "names",
    [
        (".su2", ".vtu", ".med"),
        pytest.param((".vtk", ".xdmf", ".msh", ".inp", ".vol"), marks=pytest.mark.slow),
    ],
)
def test_every_format_is_written_and_what_is_lost_is_said(ran, answers, tmp_path, names):
    banner = ran.window.banner
    for name in names:
        path = tmp_path / f"out{name}"
        answers("ask_save", path)
        banner.hide()
        ran.window.files.save_mesh()
        ran.settle()
        mesh = read(path)
        assert len(mesh.cells) == len(ran.session.mesh.cells), name
        assert np.allclose(mesh.points, ran.session.deformed.mesh.points), name
        told = banner.text.text() if banner.isVisible() else ""
        assert ("does not hold" in told) is (name not in (".su2", ".vtu", ".med")), name
        assert ("quality" in told) is (name in (".msh", ".inp", ".vol")), name
        assert ("names of the boundaries" in told) is (name in (".vtk", ".xdmf")), name


def test_a_saved_mesh_that_no_longer_fits_another_zone_is_told(driver, answers, tmp_path):
    path = zones(tmp_path)
    driver.window.files.open_path(path, 1)
    driver.settle()
    assert driver.session.case.roles["BLOCK"] == "fixed"
    panel = driver.window.dock_manager.panel(BoundariesPanel)
    row = driver.session.mesh.marker_names.index("BLOCK")
    assert "interface with core of zone 2" in panel.table.item(row, 0).toolTip()
    assert "A guess: it is an interface" in panel.table.cellWidget(row, 2).toolTip()
    moved(path).write(tmp_path / "c.cfg")
    driver.open(tmp_path / "c.cfg")
    driver.window.start_run()
    driver.settle()
    answers("ask_save", tmp_path / "out.su2")
    driver.window.files.save_mesh()
    driver.settle()
    assert "Saved. Zone 2 no longer fits: BLOCK" in driver.window.banner.text.text()


def test_formats_for_the_mesh_are_offered(opened, driver, sample_folder):
    flat = questions.mesh_filters(opened.session.mesh)
    assert flat.startswith("SU2 (keeps all")
    assert "Nastran" not in flat
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    assert "Nastran" in questions.mesh_filters(driver.session.mesh)


def test_saved_quality_is_in_the_vtu(computed, steps, tmp_path):
    import pyvista as pv

    frame = steps[-1]
    jobs.save_mesh(tmp_path / "q.vtu", frame, False, jobs.Job())
    found = pv.read(tmp_path / "q.vtu").cell_data["size_skew"]
    values = quality(frame.mesh, computed[0].session.mesh).values
    assert np.allclose(found[: len(values)], values)


# Help --------------------------------------------------------------------------------------


def every_action(menu):
    for act in menu.actions():
        if act.menu() is not None:
            yield act
            yield from every_action(act.menu())
        elif not act.isSeparator():
            yield act


def test_every_action_says_in_a_sentence_what_it_does_and_can_be_found_with_its_keys(opened):
    window = opened.window
    for top in window.menuBar().actions():
        for act in every_action(top.menu()):
            if act.isEnabled():
                assert act.statusTip().endswith("."), act.text()
    for act in window.actions_table.bar.actions():
        if act.text():
            assert len(act.toolTip().split()) >= 3, act.text()
    window = opened.window
    window.store.change(changes.set_case, steps=3)
    assert window.actions_table.by_name["undo"].text() != "Undo"
    opened.activate()
    QTest.keyClick(window, Qt.Key.Key_F1)
    dialog = window.help._shown["palette"]

    def shown():
        return [dialog.tree.topLevelItem(k) for k in range(dialog.tree.topLevelItemCount())]

    rows = shown()
    said = {(row.text(0), row.text(1)) for row in rows}
    assert {("Run", "F5"), ("Copy picture", "Ctrl+Shift+C"), ("Undo", "Ctrl+Z")} <= said
    keys = {row.text(1) for row in rows}
    assert {one.shortcut().toString() for one in window.actions_table.by_name.values()} - {
        ""
    } <= keys
    # Those of the panels, which hold for the one that has the focus, are there, too.
    panels = {shortcut.key() for shortcut in window.findChildren(QShortcut)}
    panels |= {act.shortcut() for act in window.motions.actions_table.values()}
    told = {key for row in rows for key in row.text(1).split(", ")}
    assert {key.toString() for key in panels} - {""} <= told
    dialog.search.setText("zoom to the whole mesh")
    assert [row.text(0) for row in shown()] == ["Fit all"]
    assert dialog.count.isHidden()
    dialog.search.setText("no such key")
    assert dialog.count.isVisible()
    dialog.reject()
    QTest.keyClick(window, Qt.Key.Key_F1)
    assert dialog.search.selectedText() == "no such key"


def shown_below(item):
    """Return the items below one that are shown."""
    children = [item.child(k) for k in range(item.childCount())]
    return [child for child in children if not child.isHidden()]


def test_the_manual_is_read_and_searched(opened, monkeypatch):
    opened.activate()
    QTest.keyClick(opened.window, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    dialog = opened.window.help._shown["manual"]
    assert "slideviz moves the boundaries of a mesh" in dialog.pages.toPlainText()
    dialog.search.setText("first-mesh.md")
    top = dialog.tree.invisibleRootItem()
    assert not shown_below(top)
    assert dialog.count.text() == "Nothing found"
    before = dialog.pages.source()
    QTest.keyClick(dialog.search, Qt.Key.Key_Return)
    assert dialog.pages.source() == before
    dialog.search.setText("halves a step")
    assert dialog.count.text() == "1 page"
    QTest.keyClick(dialog.search, Qt.Key.Key_Return)
    assert dialog.pages.textCursor().selectedText() == "halves a step"
    dialog.pages.backward()
    pages = [page for one in shown_below(top) for page in shown_below(one)]
    assert [page.text(0) for page in pages] == ["A cell is inverted: what now"]
    dialog.tree.setCurrentItem(pages[0])
    assert dialog.pages.toPlainText().startswith("A cell is inverted: what now")
    QTest.keyClick(dialog.search, Qt.Key.Key_Return)
    assert dialog.pages.textCursor().selectedText() == "halves a step"
    dialog.pages.setSource(dialog.pages.source().resolved(QUrl("tolerance")))  # as a link does
    assert dialog.pages.toPlainText().startswith("Choose a tolerance")
    assert dialog.tree.currentItem().text(0) == "Choose a tolerance"
    dialog.pages.backward()
    assert dialog.pages.toPlainText().startswith("A cell is inverted")
    assert dialog.tree.currentItem() is pages[0]
    dialog.reject()
    monkeypatch.setattr(manual, "PLACES", ())
    opened.window.help.manual()
    assert "was not installed" in opened.window.banner.text.text()


def test_case_keys_can_be_searched_and_there_are_details_for_a_report(opened):
    opened.window.actions_table.by_name["case_keys"].trigger()
    dialog = opened.window.help._shown["keys"]
    dialog.search.setText("periodic_mode")
    assert dialog.text.textCursor().selectedText().lower() == "periodic_mode"
    assert dialog.count.text() != "0 found"
    first = dialog.text.textCursor().position()
    while dialog.text.textCursor().position() >= first:
        before = dialog.text.textCursor().position()
        dialog.next()
        if dialog.text.textCursor().position() == before:
            break  # only one
    assert dialog.text.textCursor().hasSelection()
    window, clipboard = opened.window, QApplication.clipboard()
    window.actions_table.by_name["about"].trigger()
    window.help._shown["about"].copy.click()
    assert "numpy" in clipboard.text()
    window.actions_table.by_name["copy_details"].trigger()
    text = clipboard.text()
    mesh = opened.session.mesh
    assert f"2D, {len(mesh.cells)} cells" in text
    assert "OpenGL" in text
    assert "opened" in text


def test_a_marked_cell_is_in_pictures_unless_it_is_switched_off_and_in_films_if_wanted(ran):
    with ran.window.exports._renderer() as renderer:
        dialog = PictureDialog(ran.window, renderer)
        assert not dialog._form.isRowVisible(dialog.options["marked"])
        form = FilmForm(renderer)
        assert not form.layout().isRowVisible(form.mark)
    ran.window.store.change(changes.mark_cell, 3)
    with ran.window.exports._renderer() as renderer:
        dialog = PictureDialog(ran.window, renderer)
        assert dialog.picture_options.drawn_session(renderer.session).view.marked_cell == 3
        dialog.options["marked"].setChecked(False)
        assert dialog.picture_options.drawn_session(renderer.session).view.marked_cell is None
        assert dialog._form.isRowVisible(dialog.options["marked"])
        form = FilmForm(renderer)
        assert form.layout().isRowVisible(form.mark)
        assert form.picture_options.drawn_session(renderer.session).view.marked_cell is None
        form.mark.setChecked(True)
        assert form.picture_options.drawn_session(renderer.session).view.marked_cell == 3
    # A new run has no marked cell. One that is marked in another run is of no interest there.
    ran.window.store.change(changes.start_run)
    with ran.window.exports._renderer() as renderer:
        dialog = PictureDialog(ran.window, renderer, kept=json.dumps({"marked": True}))
        assert not dialog._form.isRowVisible(dialog.options["marked"])
    ran.window.store.change(changes.mark_cell, 3)
    ran.window.store.change(changes.show_run, ran.session.runs[0].number)
    with ran.window.exports._renderer() as renderer:
        dialog = PictureDialog(ran.window, renderer, kept=json.dumps({"marked": True}))
        assert not dialog.options["marked"].isChecked()
        assert dialog._form.isRowVisible(dialog.options["marked"])
        assert "marked" not in json.loads(dialog.choices)


def paste(qtbot, keys):
    QApplication.clipboard().clear()
    qtbot.keyClick(QApplication.activeWindow(), *keys)
    return QApplication.clipboard().text()


COPY = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier


def test_the_view_is_copied_as_a_command_that_draws_it(
    ran, qtbot, sample_folder, tmp_path, monkeypatch
):
    driver = ran
    window = driver.window
    window.viewing.fit()
    copied = paste(qtbot, (Qt.Key.Key_C, COPY))
    assert copied.startswith(f"slideviz picture {sample_folder}/passage/passage.cfg -o passage.png")
    assert "VIEW_COLOR=size-skew" in copied
    first, *_ = copied.split(" \\\n")
    assert window.statusBar().currentMessage() == f"Copied: {first}"
    program = paste(qtbot, (Qt.Key.Key_P, COPY))
    assert program.startswith("import slideviz as sv\n")
    assert "Copied: sv.picture(" in window.statusBar().currentMessage()
    monkeypatch.chdir(tmp_path)
    _, *words = shlex.split(copied.replace("\\\n", ""))
    assert run([*words, "-q"]) == 0
    window.exports.copy_picture()
    ours = QApplication.clipboard().image()
    ours.save("window.png")
    with Image.open("window.png") as one, Image.open("passage.png") as other:
        assert picture_difference(one.convert("RGB"), other.convert("RGB")) == ""


def test_what_cannot_be_copied_says_why(opened, qtbot):
    window = opened.window
    act = window.actions_table.by_name["copy_picture_0"]
    assert not act.isEnabled(), "no case file"
    assert "Save the case first" in act.toolTip()
    assert not paste(qtbot, (Qt.Key.Key_C, COPY))


def test_an_error_of_copying_is_shown(ran, qtbot):
    window = ran.window
    file = ran.session.case.source
    case = ran.session.case.change(source=file.with_name("none.cfg"))
    window.store.change(changes.saved_case, case)
    paste(qtbot, (Qt.Key.Key_C, COPY))
    assert "no such case file" in window.banner.text.text()


def test_a_report_has_the_view_and_all_runs(with_runs, tmp_path, answers):
    driver = with_runs({"steps": 1}, {"steps": 2})
    path = tmp_path / "all.html"
    answers("ask_save", path)
    driver.window.actions_table.by_name["export_report"].trigger()
    report = read_report(path)
    assert len(report.pictures) == 2
    assert ["run", "1", "2"] in report.tables["Runs"]
    assert ["STEPS", "2"] in report.tables["Case"]
    assert str(path) in driver.window.statusBar().currentMessage()


def test_the_view_becomes_a_web_page(ran, tmp_path, answers):
    answers("ask_save", tmp_path / "view.html")
    ran.window.actions_table.by_name["export_page"].trigger()
    text = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert "<canvas" in text
    assert "min 0." in text, "the title has the quality"
    assert "view.html" in ran.window.statusBar().currentMessage()


def test_a_report_that_cannot_be_written_says_so(ran, tmp_path, answers):
    answers("ask_save", tmp_path / "no" / "all.html")
    ran.window.actions_table.by_name["export_report"].trigger()
    assert "all.html" in ran.window.banner.text.text()
