"""Where the system has no OpenGL, VTK would crash: pictures are refused before anything is run."""

import re
from types import SimpleNamespace

import pytest

from slideviz.cli import run
from slideviz.errors import SlidevizError
from slideviz.export import offscreen
from slideviz.export.offscreen import check_drawable, has_opengl
from slideviz.samples.table import write_sample
from slideviz.system import missing_libraries

LACKING = (
    "pictures need OpenGL, which this system does not have; on Debian or Ubuntu use `sudo apt-"
)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "-o", "out.su2", "--picture", "out.png"),
        ("picture", "-o", "out.png"),
        ("film", "-o", "out.gif"),
    ],
)
def test_pictures_are_refused_before_the_run(words, tmp_path, monkeypatch, capsys):
    write_sample("square", tmp_path, 12)
    monkeypatch.chdir(tmp_path)
    before = {path.name for path in tmp_path.iterdir()}
    monkeypatch.setattr(offscreen, "has_opengl", lambda: False)
    command, *options = words
    assert run([command, "square.cfg", *options]) == 1
    assert LACKING in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == before


def test_a_size_is_refused_first(monkeypatch):
    monkeypatch.setattr(offscreen, "has_opengl", lambda: False)
    with pytest.raises(SlidevizError, match="0x0 pixels cannot be drawn"):
        check_drawable((0, 0))
    with pytest.raises(SlidevizError, match=re.escape(LACKING)):
        check_drawable((640, 480))


@pytest.mark.parametrize(
    ("server", "kind", "there", "able"),
    [
        (False, "vtkEGLRenderWindow", (), True),
        (False, "vtkOSOpenGLRenderWindow", (), False),
        (False, "vtkOSOpenGLRenderWindow", ("libOSMesa.so.8",), True),
        (True, "", (), False),
        (True, "", ("libGL.so.1",), True),
    ],
)
def test_opengl_is_what_vtk_can_load(server, kind, there, able, monkeypatch):
    window = SimpleNamespace(GetClassName=lambda: kind)
    # What is set here is taken back: pictures by EGL beside a window by GLX are black.
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    monkeypatch.setattr(offscreen, "needs_server", lambda: True)
    monkeypatch.setattr(offscreen, "has_x_server", lambda: server)
    monkeypatch.setattr(offscreen, "vtkRenderWindow", lambda: window)
    monkeypatch.setattr(offscreen, "is_loadable", lambda names: bool({*names} & {*there}))
    assert has_opengl.__wrapped__() is able


def test_libraries_of_the_window_are_named_by_their_packages(monkeypatch, tmp_path, capsys):
    def load(name):
        if "xcb-cursor" in name or "libGL." in name:
            raise OSError(name)

    monkeypatch.setattr(missing_libraries.ctypes, "CDLL", load)
    monkeypatch.setattr(missing_libraries, "needs_server", lambda: True)
    assert missing_libraries.missing_for_window() == ["libgl1", "libxcb-cursor0"]
    monkeypatch.setattr(offscreen, "display_fault", lambda: "")
    assert run([]) == 1
    assert "use `sudo apt-get install libgl1 libxcb-cursor0`" in capsys.readouterr().err
    monkeypatch.setattr(missing_libraries.sys, "_MEIPASS", str(tmp_path), raising=False)
    (tmp_path / "libxcb-cursor.so.0").touch()
    assert missing_libraries.missing_for_window() == ["libgl1"]
    monkeypatch.setattr(missing_libraries, "needs_server", lambda: False)
    assert missing_libraries.missing_for_window() == []
