"""A panel fills its widgets once at the start, and then only when what it shows has changed."""

from slideviz.gui.widgets.panel import Panel
from slideviz.session import changes
from slideviz.session.state import Session
from tests.windows import services


class Steps(Panel):
    """A panel that shows the number of steps."""

    def make(self) -> None:
        self.every: list[int] = []
        self.selected: list[int] = []
        self.follow(
            lambda session: session.case.steps, lambda s: self.selected.append(s.case.steps)
        )
        self.follow()

    def sync(self, session: Session) -> None:
        self.every.append(session.case.steps)


def test_a_panel_follows_what_it_shows(qtbot):
    window = services([])
    store = window.store
    panel = Steps(window)
    qtbot.addWidget(panel)
    for steps, width in ((3, True), (3, False), (4, True)):
        store.change(changes.set_case, steps=steps)
        store.change(changes.set_view, handle=width)
    first = Session().case.steps
    assert panel.selected == [first, 3, 4]
    assert panel.every == [first, 3, 3, 3, 3, 4, 4]
