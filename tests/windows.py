"""Windows of tests on a screen."""

from types import SimpleNamespace

from qtpy.QtGui import QGuiApplication

from slideviz.session.store import Store


def come_to_rest() -> None:
    """Wait until layouts have followed, the X server knows all sizes, and what it said was heard.

    What a timer of more than 0 ms puts off may still come.
    """
    for _ in range(3):
        QGuiApplication.sync()


def services(flown: list) -> SimpleNamespace:
    """Return what a panel needs of a window; ``flown`` gets the cells that the view flies to."""
    viewing = SimpleNamespace(fly_to=flown.append, fly_back=lambda: flown.append("back"))
    return SimpleNamespace(store=Store(), viewing=viewing)
