"""Draw the window in typical states, as the documentation shows it: ``python -m tools.shots``.

The pictures are grabbed from the screen: a window rendered into a picture by Qt would have tab
bars that are not visible.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slideviz.case.model import Case
from slideviz.case.motions.box import Ffd
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.cli import run
from slideviz.errors import SlidevizError
from slideviz.formats.files import read, write
from slideviz.formats.openfoam_paths import mesh_path
from slideviz.gui.panels.curves import CurvesPanel
from slideviz.gui.panels.sections import SectionsPanel
from slideviz.gui.widgets.plot_canvas import PlotCanvas
from slideviz.samples.table import sample, write_sample
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.solver.deform import deform
from slideviz.system.cleanup import draft, killed_at_end
from slideviz.terms import Role
from tests.polymesh_files import honeycomb_case, write_polymesh

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

SIZE = (1280, 800)
"""Width and height of the window in pixels."""

APART, MANY, EXACT = 192, 40, 24
"""Numbers of colors in a picture's palette: mutually distant; of large areas; most frequent."""

PATIENCE = 300.0
"""Longest time to wait for the window, in seconds."""


def wait(until: Callable[[], bool]) -> None:
    """Process events until ``until()`` is true.

    Raises
    ------
    SlidevizError
        It is not true within `PATIENCE`.
    """
    from qtpy.QtWidgets import QApplication

    end = time.monotonic() + PATIENCE
    while not until():
        if time.monotonic() > end:
            raise SlidevizError(f"the window did not get ready within {PATIENCE:.0f} s")
        QApplication.processEvents()
        time.sleep(0.01)


def settle(window: MainWindow) -> None:
    """Wait until no job runs, half a second more for delayed drawings, and for all plots."""
    wait(lambda: not window.runner.busy)
    end = time.monotonic() + 0.5
    wait(lambda: time.monotonic() > end)
    wait(lambda: not any(plot.busy for plot in window.findChildren(PlotCanvas)))


STATOR_CELLS = 40_000
"""Approximate number of cells of the sample ``stator``."""

IMPELLER_CELLS = 30_000
WING_CELLS = 40_000
"""Approximate numbers of cells of the centrifugal compressor, and of the sample ``wing``."""

TURNED: tuple[Motion, ...] = (
    Rotate("BLADE", 15.0, (0.275, 0.0, 0.0525), (1.0, 0.0, 0.0)),
    Rotate("BLADE", 2.5, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
)
"""The blade is staggered by 15 degrees, and moved around the machine by 2.5 of its 8.8 degrees."""

FAR: tuple[Motion, ...] = (Rotate("airfoil", -14.0), Translate("airfoil", (0.0, 0.2)))
"""Motions for the sample ``passage``, larger than those of its own case."""

NEAR_HUB = 0.2512
"""Radius of the cut in thesis Figure 6.20, in metres."""

SLIDING = {"sliding": "ds", "periodic": "moving"}
OUTER = ("SHROUD", "PER1", "PER2", "INFLOW", "OUTFLOW")
"""The stator's boundaries between the camera and the blade."""


@dataclass(frozen=True)
class ShotState:
    """A state of the window to be pictured: the picture's name, and the function that sets it up.

    ``bring`` is called with the window and a folder for its files.
    """

    name: str
    bring: Callable[[MainWindow, Path], None]


def _stator(place: Path) -> Path:
    """Return the stator's case, written once; its motions are `TURNED`, not a displacement file."""
    folder = place / "stator"
    if not folder.exists():
        write_sample("stator", folder, STATOR_CELLS)
        case = Case.read(folder / "stator.cfg")
        case.change(motions=TURNED, steps=5).write(folder / "stator.cfg")
    return folder / "stator.cfg"


def _open(window: MainWindow, path: Path) -> None:
    window.files.open_path(path)
    settle(window)


def _run(window: MainWindow, **changed: Any) -> None:
    """Change settings of the case, run it, and wait for its end."""
    window.store.change(changes.set_case, **changed)
    window.start_run()
    settle(window)


def _look(window: MainWindow, azimuth: float, elevation: float) -> None:
    """Turn the camera about the mesh by angles in degrees, and fit the mesh."""
    camera = window.scene.plotter.camera
    camera.Azimuth(azimuth)
    camera.Elevation(elevation)
    camera.OrthogonalizeViewUp()
    window.viewing.fit()
    window.viewing.render()


def roles(window: MainWindow, place: Path) -> None:
    """Show the stator with guessed roles, and the menu that changes the role of a boundary."""
    from qtpy.QtCore import QPoint

    from slideviz.gui.panels.boundaries import boundary_menu

    _open(window, _stator(place).with_name("mesh.su2"))
    store = window.store
    store.change(changes.set_role, ["BLADE"], "moving")
    store.change(changes.set_role, ["HUB", "SHROUD"], "internal")
    for motion in TURNED:
        store.change(changes.add_motion, motion)
    store.change(changes.show_boundaries, ["SHROUD", "PER1"], False)
    store.change(changes.select, ("INFLOW",))
    _look(window, 30.0, -8.0)
    view = window.view
    menu = boundary_menu(window, store, ("INFLOW",))
    menu.popup(view.mapToGlobal(QPoint(view.width() * 7 // 10, view.height() * 2 // 3)))
    menu.setActiveAction(next(act for act in menu.actions() if act.text() == "&Sliding"))


def quality(window: MainWindow, place: Path) -> None:
    """Show the stator after a run, with neighbouring passages."""
    _open(window, _stator(place))
    _run(window, **SLIDING)
    window.store.change(changes.show_boundaries, OUTER, False)
    window.store.change(changes.set_view, passages=1)
    _look(window, 30.0, 0.0)


def twist(window: MainWindow, place: Path) -> None:
    """Show the curve of a twist over the span, with its ghost."""
    _open(window, _stator(place))
    curve = SpanMotion("BLADE", "twist", (0.0, 0.5, 1.0), (0.0, 0.5, 3.0))
    window.store.change(changes.set_case, motions=(curve,))
    window.store.change(changes.show_boundaries, OUTER, False)
    window.motions.editor.drawn.setFocus()
    _look(window, 30.0, -8.0)


def wing(window: MainWindow, place: Path) -> None:
    """Show a wing's twist, with its ghost, between the symmetry plane and its tip."""
    _, case = write_sample("wing", place / "wing", WING_CELLS)
    _open(window, case)
    window.store.change(changes.show_boundaries, ("farfield",), False)
    window.store.change(
        changes.set_case, motions=(SpanMotion("wing", "twist", (0.0, 1.0), (0.0, 25.0)),)
    )
    window.motions.editor.drawn.setFocus()
    _look(window, 140.0, 0.0)
    camera = window.scene.plotter.camera
    camera.focal_point = (0.9, 1.2, 0.0)
    camera.zoom(4.2)
    window.viewing.render()
    settle(window)


def handle(window: MainWindow, place: Path) -> None:
    """Show the blade of the stator with its handle, moved and turned."""
    _open(window, _stator(place))
    window.store.change(changes.show_boundaries, OUTER, False)
    window.store.change(changes.select, ("BLADE",))
    _look(window, 30.0, -8.0)


def box(window: MainWindow, place: Path) -> None:
    """Show a free-form box around the blade of the stator, a column of its points moved."""
    _open(window, _stator(place))
    store = window.store
    moved = Ffd("BLADE", "", (2, 1, -1), (0.006, 0.0, 0.0))
    store.change(changes.set_case, motions=(moved,))
    store.change(changes.add_box, 0)
    store.change(changes.choose_motion, 0)
    store.change(changes.show_boundaries, OUTER, False)
    _look(window, 30.0, -8.0)


def wheel(window: MainWindow, place: Path) -> None:
    """Show all passages of the stator after a run."""
    _open(window, _stator(place))
    _run(window, **SLIDING)
    window.store.change(changes.show_boundaries, OUTER, False)
    window.store.change(changes.set_view, passages=-1)
    _look(window, 30.0, 25.0)


def onto(window: MainWindow, place: Path) -> None:
    """Show the ghost of the stator's blade on the surface that it is laid onto."""
    path = _stator(place)
    case = Case.read(path)
    assert case.mesh_file is not None
    built = case.change(motions=(FromFile(path.parent / "displacement.txt"),), steps=1)
    (step,) = deform(built, read(case.mesh_file))
    write(place / "built.su2", step.mesh)
    _open(window, path)
    window.store.change(changes.remove_motion, 1)
    window.store.change(changes.replace_motion, 0, Onto(place / "built.su2", "BLADE"))
    wait(lambda: bool(window.store.session.laid))
    window.store.change(changes.show_boundaries, OUTER, False)
    _look(window, 60.0, 0.0)


def section(window: MainWindow, place: Path) -> None:
    """Show a cylindrical section at mid-span, unrolled below the 3D view."""
    _open(window, _stator(place))
    _run(window, **SLIDING)
    window.dock_manager.bring_to_front("sections")
    window.dock_manager.panel(SectionsPanel).add["cylinder"].click()
    window.store.change(changes.set_view, passages=1)
    window.section_views.want_flat(True)
    window.store.change(changes.show_boundaries, OUTER, False)
    settle(window)
    window.section_views.setSizes([45, 55])
    _look(window, 25.0, -10.0)


def _near_hub(window: MainWindow, other: int, zoom: float) -> None:
    """Show the last run beside another one, on a cylindrical section near the hub, magnified."""
    window.store.change(changes.add_section, Section("cylinder", radius=NEAR_HUB))
    window.store.change(changes.show_boundaries, ("BLADE", "HUB", *OUTER), False)
    window.store.change(changes.show_beside, other)
    settle(window)
    window.viewing.look_from("+x")
    settle(window)
    (_, (view, scene)) = window.viewing.views_and_scenes()
    scene.camera.zoom_at(0.62 * view.width(), 0.4 * view.height(), zoom)


def span(window: MainWindow, place: Path) -> None:
    """Show a section at 90 % span, laid flat, and the throat by span before and after the run."""
    _open(window, _stator(place))
    _run(window, **SLIDING)
    window.dock_manager.bring_to_front("sections")
    panel = window.dock_manager.panel(SectionsPanel)
    panel.add["span"].click()
    panel.editor.changed.emit(window.store.session.view.sections[0].sized(0.9))
    window.store.change(changes.set_view, passages=1)
    window.section_views.want_flat(True)
    window.store.change(changes.show_boundaries, OUTER, False)
    window.dock_manager.bring_to_front("curves")
    window.dock_manager.panel(CurvesPanel).show_kind("gaps")
    settle(window)
    _look(window, 25.0, -10.0)


def beside(window: MainWindow, place: Path) -> None:
    """Show two methods side by side, on a cylindrical section near the hub."""
    _open(window, _stator(place))
    _run(window, sliding="none", periodic="none")
    _run(window, **SLIDING)
    _near_hub(window, 1, 1.06)


def repaired(window: MainWindow, place: Path) -> None:
    """Show the held passage of `beside` with and without its repair, near the folded cells."""
    _open(window, _stator(place))
    _run(window, sliding="none", periodic="none", repair="no")
    _run(window, repair="auto")
    _near_hub(window, 1, 2.0)


def zones(window: MainWindow, place: Path) -> None:
    """Show two rows of blades, with pitches of their own, as the zones of one file."""
    import slideviz as sv

    write_sample("passage", place / "row", 24)
    first = place / "row" / "mesh.su2"
    row, case = sv.read(first), Case.read(place / "row" / "passage.cfg")
    low, high = row.bounds
    second = place / "second.su2"
    sv.write(second, row.with_points(row.points * [1.0, 0.75] + [high[0] - low[0], 0.0]))
    texts = "".join(f"IZONE= {k}\n{one.read_text()}" for k, one in enumerate((first, second), 1))
    (place / "stage.su2").write_text(f"NZONE= 2\n{texts}")
    roles = {f"{k}:{name}": role for k in (1, 2) for name, role in case.roles.items()}
    turns = (Rotate("1:airfoil", -8.0), Rotate("2:airfoil", 6.0))
    case = case.change(mesh_file=place / "stage.su2", roles=roles, motions=turns)
    case.write(place / "stage.cfg")
    _open(window, place / "stage.cfg")
    _run(window)


def openfoam(window: MainWindow, place: Path) -> None:
    """Show a run of an OpenFOAM case of hexagonal prisms around a body."""
    folder = place / "honeycomb"
    points, cells, patches = honeycomb_case()
    kinds = {"ends": "symmetryPlane"}
    write_polymesh(folder / "constant" / "polyMesh", points, cells, patches, kinds)
    roles: dict[str, Role] = {"body": "moving", "ends": "sliding", "far": "fixed"}
    motions = (Rotate("body", 25.0), Translate("body", (2.0, 0.0, 0.0)))
    case = Case(mesh_file=mesh_path(folder), roles=roles, sliding="ps", motions=motions)
    case.write(place / "honeycomb.cfg")
    _open(window, place / "honeycomb.cfg")
    _run(window)
    _look(window, 45.0, 30.0)
    window.scene.plotter.camera.zoom(1.6)
    window.viewing.render()
    settle(window)


def dark(window: MainWindow, place: Path) -> None:
    """Show a run of the 2D passage and its curves, in the dark theme."""
    window.set_theme("dark")
    write_sample("passage", place / "passage", 48)
    case = Case.read(place / "passage" / "passage.cfg")
    case.change(motions=FAR).write(place / "passage" / "passage.cfg")
    _open(window, place / "passage" / "passage.cfg")
    _run(window)
    window.store.change(changes.set_view, passages=1)
    window.dock_manager.bring_to_front("curves")


WINDOW_FILM = (960, 600)
"""Width and height of the film of the window in pixels."""

TURN, LIFT = -14.0, 0.2
"""How the mouse moves the airfoil in the film: turned by degrees, then up by a length."""

TURNS, LIFTS = 26, 14
"""Number of images of each."""

POINTER = ((0, 0), (0, 17), (4, 13), (7, 20), (10, 19), (7, 12), (12, 12))
"""Corners of the mouse pointer, which the screen does not have, in pixels from its tip."""

STATES = (
    ShotState("roles", roles),
    ShotState("quality", quality),
    ShotState("twist", twist),
    ShotState("wing", wing),
    ShotState("handle", handle),
    ShotState("box", box),
    ShotState("wheel", wheel),
    ShotState("onto", onto),
    ShotState("section", section),
    ShotState("machine-span", span),
    ShotState("side-by-side", beside),
    ShotState("repaired", repaired),
    ShotState("zones", zones),
    ShotState("openfoam", openfoam),
    ShotState("dark", dark),
)


def film_of_window(window: MainWindow, path: Path, place: Path) -> Path:
    """Write a film of ten seconds in which the mouse drags a blade, with the live preview."""
    import numpy as np
    from PIL import Image
    from qtpy.QtCore import QPoint, Qt
    from qtpy.QtTest import QTest

    from slideviz.scene.pick import Projection

    write_sample("passage", place / "film", 60)
    _open(window, place / "film" / "passage.cfg")
    store = window.store
    store.change(changes.set_case, motions=(Rotate("airfoil", 0.0), Translate("airfoil", (0, 0))))
    store.change(changes.set_view, passages=1, color_by="size-skew")
    store.change(changes.choose_motion, 0)
    window.live.switch(True)
    wait(lambda: window.live.fields is not None)
    view = window.view
    mouse = window.viewing.handles[view]
    frames: list[Any] = []

    def spot(pixel: Any) -> QPoint:
        x, y = np.asarray(pixel) / view.devicePixelRatioF()
        return QPoint(round(x), round(view.height() - 1 - y))

    def take(pixel: Any) -> None:
        """Move the mouse to a pixel of the view, and film what comes of it."""
        QTest.mouseMove(view, spot(pixel))
        frames.append(_with_pointer(_seen(window, place), view.mapTo(window, spot(pixel))))

    def drag(grip: Any, pixels: Callable[[Any, Any], Any]) -> None:
        """Drag a part of the handle along ``pixels(start, middle)``, an array (k, 2)."""
        _seen(window, place)
        line = next(part.line for part in mouse.parts if part.grip == grip)
        start = line[0] if len(line) > 2 else line.mean(axis=0)
        middle = Projection.of(view).pixels(mouse.placed().origin[None])[0]
        take(start)
        QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=spot(start))
        for pixel in pixels(start, middle):
            take(pixel)
        QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=spot(pixel))

    def around(start: Any, middle: Any) -> Any:
        turns = np.exp(1j * np.radians(np.linspace(0.0, TURN, TURNS)))
        spokes = ((start - middle) @ [1.0, 1.0j]) * turns
        return middle + np.column_stack([spokes.real, spokes.imag])

    def up(start: Any, _middle: Any) -> Any:
        ends = Projection.of(view).pixels(np.array([[0.0, 0.0, 0.0], [0.0, LIFT, 0.0]]))
        return start + np.linspace(0.0, 1.0, LIFTS)[:, None] * (ends[1] - ends[0])

    drag(("turn", (2,)), around)
    wait(lambda: not window.runner.busy and bool(store.session.runs))
    drag(("move", (1,)), up)
    wait(lambda: store.session.preview is None and not store.session.outdated)
    settle(window)
    frames.append(_seen(window, place))
    # One palette for all pictures: what does not move keeps its bits, and the file stays small.
    palette = frames[-1].quantize(255, Image.Quantize.MAXCOVERAGE, kmeans=1)
    first, *others = (frame.quantize(palette=palette, dither=0) for frame in frames)
    times = [600, *[190] * (len(others) - 1), 2600]
    first.save(path, save_all=True, append_images=others, duration=times, loop=0, optimize=True)
    return path


def _seen(window: MainWindow, place: Path) -> Any:
    """Return what the screen shows of a window, once the preview of its case is drawn."""
    from PIL import Image

    live = window.live
    session = window.store.session
    wait(lambda: not live._runner.busy and not window.runner.busy)
    if session.preview is not None and session.preview.case is not session.case:
        live.begin()
        wait(lambda: window.store.session.preview.case is window.store.session.case)
    wait(lambda: not any(plot.busy for plot in window.findChildren(PlotCanvas)))
    window.viewing.render()
    end = time.monotonic() + 0.15
    wait(lambda: time.monotonic() > end)
    with Image.open(_grabbed(window, place / "frame.png")) as image:
        return image.convert("RGB").resize(WINDOW_FILM, Image.Resampling.LANCZOS)


def _with_pointer(image: Any, tip: Any) -> Any:
    """Return a picture of the window with the mouse pointer at a place in the window."""
    from PIL import ImageDraw

    part = WINDOW_FILM[0] / SIZE[0]
    corners = [(part * tip.x() + x, part * tip.y() + y) for x, y in POINTER]
    ImageDraw.Draw(image).polygon(corners, fill="black", outline="white")
    return image


def film_of_passage(path: Path) -> Path:
    """Write a film of the 2D passage, as in the dark picture, and return its path."""
    from slideviz.export.film import FilmOptions, film
    from slideviz.mesh.quality import quality as quality_of
    from slideviz.session.opening import session_of_runs
    from slideviz.session.state import Run, StepFrame
    from slideviz.solver.deform import deform

    made = sample("passage", 24)
    case = made.case.change(motions=FAR)
    steps = deform(case, made.mesh)
    frames = tuple(StepFrame(step.mesh, quality_of(step.mesh, made.mesh), step) for step in steps)
    session = session_of_runs(
        StepFrame(made.mesh, quality_of(made.mesh)), [Run(1, case, frames, "done")]
    )
    for _ in film(session, path, FilmOptions((480, 300), 5.0, 1.5, 1), overwrite=True):
        pass
    return path


def film_in_time(path: Path, place: Path) -> Path:
    """Write a film of the 2D passage at the times of a table, and return its path."""
    write_sample("passage", place / "moving", 24)
    rows = (f"{k},{8.0 * math.sin(math.pi * k / 8)},0.0" for k in range(16))
    table = place / "motion.csv"
    table.write_text("\n".join(["time,airfoil.rotate.angle_deg,airfoil.translate.y", *rows]))
    call = ["film", str(place / "moving" / "passage.cfg"), "--designs", str(table), "-q"]
    if run([*call, "--size", "480x300", "--hold", "0.1", "--force", "-o", str(path)]):
        raise SlidevizError(f"{path}: the film was not written")
    return path


def shots(folder: Path) -> list[Path]:
    """Write all pictures, and the film, into a folder, and return their paths.

    Raises
    ------
    SlidevizError
        The folder cannot be written to, there is no screen, or the window does not get ready.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise SlidevizError(f"{folder}: cannot create this folder ({problem.strerror})") from None
    with draft(Path(tempfile.gettempdir()), is_folder=True) as place, display():
        made = []
        for state in STATES:
            with open_window(place) as window:
                state.bring(window, place)
                made.append(photograph(window, folder / f"{state.name}.png"))
        with open_window(place) as window:
            made.append(film_of_window(window, folder / "window.gif", place))
        made.append(film_of_passage(folder / "passage.gif"))
        made.append(film_in_time(folder / "in_time.gif", place))
        return [*made, *machine_pictures(folder, place)]


def machine_pictures(folder: Path, place: Path) -> list[Path]:
    """Write a compressor's section and meridional view, and a throat; return their paths."""
    from slideviz.samples.impeller import impeller_mesh

    mesh, case = place / "impeller.su2", str(_stator(place))
    write(mesh, impeller_mesh(IMPELLER_CELLS))
    made = [folder / f"machine-{name}.png" for name in ("flat", "meridional", "throat")]
    files = [str(path) for path in made]
    for command in (
        ["section", str(mesh), "--span", "0.5", "--copies", "1", "-o", files[0]],
        ["section", str(mesh), "--meridional", "--size", "1400x900", "-o", files[1]],
        ["gap", case, "-q", "-o", files[2]],
    ):
        run(command)
    for path in made:
        shrink(path)
    return made


@contextmanager
def display() -> Iterator[None]:
    """Provide a display within the context: an Xvfb of its own; without Xvfb the present one.

    Raises
    ------
    SlidevizError
        There is no screen and no Xvfb to make one.
    """
    from qtpy.QtWidgets import QApplication

    program = shutil.which("Xvfb")
    names = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    before = {name: os.environ[name] for name in names if name in os.environ}
    there = before.get("DISPLAY") or before.get("WAYLAND_DISPLAY")
    if QApplication.instance() is not None or (program is None and there):
        yield
        return
    if program is None:
        raise SlidevizError("there is no display and no Xvfb; install Debian's package xvfb")
    read, write = os.pipe()
    call = [program, "-displayfd", str(write), "-screen", "0", "1920x1080x24", "-nolisten", "tcp"]
    server = subprocess.Popen(call, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with killed_at_end(server):
        try:
            with os.fdopen(read) as number:
                os.environ["DISPLAY"] = f":{number.readline().strip()}"
            os.environ.pop("WAYLAND_DISPLAY", None)
            os.environ["QT_QPA_PLATFORM"] = "xcb"
            yield
        finally:
            for name in names:
                os.environ.pop(name, None)
            os.environ.update(before)
            server.terminate()
            server.wait()


@contextmanager
def open_window(place: Path) -> Iterator[MainWindow]:
    """Provide a window of `SIZE`, with settings of its own in a folder instead of the user's."""
    from qtpy.QtCore import QSettings
    from qtpy.QtWidgets import QApplication

    from slideviz.gui.widgets import questions
    from slideviz.gui.window import MainWindow

    app = QApplication.instance() or QApplication(["slideviz"])
    settings = QSettings(str(place / "settings.ini"), QSettings.Format.IniFormat)
    settings.clear()
    window = MainWindow(settings)
    window.resize(*SIZE)
    window.move(0, 0)
    window.show()
    questions.ask_unsaved, asked = (lambda *_: "discard"), questions.ask_unsaved
    try:
        yield window
    finally:
        window.close()
        questions.ask_unsaved = asked
        app.processEvents()


def photograph(window: MainWindow, path: Path) -> Path:
    """Write a picture of the part of the screen where the window is, and return its path.

    Raises
    ------
    SlidevizError
        The file cannot be written.
    """
    settle(window)
    window.view.snapshot()
    window.viewing.render()
    settle(window)
    shrink(_grabbed(window, path))
    return path


def _grabbed(window: MainWindow, path: Path) -> Path:
    """Write what the screen has where the window is, and return the path."""
    frame = window.geometry()
    shown = window.screen().grabWindow(0, frame.x(), frame.y(), frame.width(), frame.height())
    if not shown.save(str(path)):
        raise SlidevizError(f"{path}: the picture cannot be written; choose another folder")
    return path


def shrink(path: Path) -> None:
    """Reduce a PNG picture to a palette of 256 colors: a third of its size, hardly visible."""
    import numpy as np
    from PIL import Image
    from scipy.spatial import KDTree

    with Image.open(path) as image:
        drawn = image.convert("RGB")
    # A red cell keeps its red, a shaded background has no bands, and white stays white.
    apart = drawn.quantize(APART, Image.Quantize.MAXCOVERAGE, kmeans=1).getpalette() or []
    many = drawn.quantize(MANY, Image.Quantize.MEDIANCUT).getpalette() or []
    counted = sorted(drawn.getcolors(drawn.width * drawn.height) or [], reverse=True)
    exact = np.ravel([color for _, color in counted[:EXACT]]).tolist()
    palette = apart[: 3 * APART] + many[: 3 * MANY] + exact
    # Pillow's own search for the nearest color is coarse: it maps 255 to 250.
    tree = KDTree(np.reshape(palette, (-1, 3)))
    colors, where = np.unique(np.asarray(drawn).reshape(-1, 3), axis=0, return_inverse=True)
    nearest = np.asarray(tree.query(colors)[1], np.uint8)[where.ravel()]
    fewer = Image.fromarray(nearest.reshape(drawn.height, drawn.width), "P")
    fewer.putpalette(palette)
    fewer.save(path, optimize=True)


def main() -> None:
    """Draw the pictures into a folder, and print their paths."""
    parser = argparse.ArgumentParser(prog="python -m tools.shots", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("screenshots"), metavar="DIR")
    for path in shots(parser.parse_args().output):
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
