"""The window does not write over what it has read, unless that was asked for."""

import pytest

from slideviz.errors import SlidevizError
from slideviz.gui.widgets import questions
from slideviz.system.atomic import atomic_write

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def opened(window, driver, passage_file):
    driver.open(passage_file)
    return window


def test_exports_spare_what_was_read(opened, tmp_path):
    session = opened.store.session
    before = session.path.read_bytes()
    with (
        pytest.raises(SlidevizError, match="is the mesh that is open; choose another name"),
        atomic_write(session.path, SlidevizError) as file,
    ):
        file.write(b"picture")
    assert session.path.read_bytes() == before


def test_a_case_is_not_saved_over_the_mesh(opened, monkeypatch):
    path = opened.store.session.path
    before = path.read_bytes()
    monkeypatch.setattr(questions, "ask_save", lambda *_: path)
    assert not opened.files.save_case()
    assert path.read_bytes() == before
    assert "choose another name" in opened.banner.text.text()


@pytest.mark.window("own")
def test_a_closed_window_spares_nothing_any_more(opened, monkeypatch):
    path = opened.store.session.path
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
    opened.close()
    with atomic_write(path) as file:
        file.write(b"new")
    assert path.read_bytes() == b"new"
