"""Windows of tests on a screen."""

from qtpy.QtGui import QGuiApplication


def come_to_rest() -> None:
    """Wait until layouts have followed, the X server knows all sizes, and what it said was heard.

    What a timer of more than 0 ms puts off may still come.
    """
    for _ in range(3):
        QGuiApplication.sync()
