"""What each action does, in a sentence, and tooltips in lines that can be read."""

from __future__ import annotations

import html

from qtpy.QtCore import Qt
from qtpy.QtGui import QFontMetrics
from qtpy.QtWidgets import QLabel, QToolTip, QWidget

from slideviz.case.section_shapes import SECTION_SHAPES

TIPS: dict[str, str] = {
    "open": "Open a mesh, or a case with its mesh.",
    "open_recent": "Open one of the files used last.",
    "open_sample": "Open a case that comes with the program.",
    "sample_of_size": "Open a sample with fewer or more cells.",
    "save_mesh": "Save the mesh of the step that is shown.",
    "save_case": "Save roles, motions, method and view as a case that gives the same result again.",
    "export": "Take away pictures, films, tables and meshes.",
    "save_picture": "Make a picture of the view for a paper or a slide.",
    "copy_picture": "Copy a picture of the view, with a white background, to the clipboard.",
    "export_film": "Make a film of the steps.",
    "export_quality": "Save the quality of every cell of the step that is shown as a CSV table.",
    "export_steps": "Save the mesh of every step, each in a file of its own.",
    "quit": "Close the window; unsaved changes are asked about.",
    "undo": "Take back the last change.",
    "redo": "Make the change again that was taken back.",
    "run": "Deform the mesh with these settings.",
    "cancel": "Stop what runs; the steps that are done are kept.",
    "fit": "Make the whole mesh fill the view.",
    "colours": "From which value to which the colours range.",
    "fit_colours": "Let the colours range over the values of the step that is shown, and of the "
    "other one in a comparison.",
    "fit_all_colours": "Let the colours range over the values of all steps, so that they say the "
    "same in a film.",
    "usual_colours": "Let the colours range as they do at first.",
    "look_from": "Look at the mesh from a side.",
    "sideiso": "Look at the mesh from a corner.",
    "compare": "Show the undeformed mesh or another run beside the run that is shown.",
    "show_all": "Show the boundaries that were hidden.",
    **{f"add_{kind}": row.tip_to_add for kind, row in SECTION_SHAPES.items()},
    "steps": "Show another step of the deformation.",
    "step_first": "Show the mesh before it is deformed.",
    "step_previous": "Show the step before this one.",
    "step_play": "Show the steps one after the other, or stop that.",
    "step_next": "Show the step after this one.",
    "step_last": "Show the deformed mesh.",
    "theme": "Light or dark colours.",
    "theme_system": "Take light or dark colours as the desktop does.",
    "theme_light": "Take light colours.",
    "theme_dark": "Take dark colours.",
    "panels": "Show and hide the panels around the view.",
    "hide_panels": "Hide every panel, so that the view has all the room, or show them again.",
    "full_screen": "Fill the screen with the window, or end that.",
    "restore_layout": "Put every panel back to where it was at first.",
    "shortcuts": "Show all keys and what the mouse does.",
    "case_keys": "Show and search the keys of a case file.",
    "copy_details": "Copy versions, graphics, mesh and the last messages, for a bug report.",
    "about": "Show version and licence.",
}
"""By the name of the action or menu."""


def tip_of(name: str, text: str) -> str:
    """Return what an action or menu does, in a sentence."""
    if name.startswith("side") and name not in TIPS:
        return f"Look at the mesh from {name.removeprefix('side')}."
    return TIPS.get(name, f"{text.replace('…', '').replace('&', '')}.")


def rich_label(text: str) -> QLabel:
    """Return a label for rich text; names in it must be escaped."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.RichText)
    return label


def plain_labels(widget: QWidget) -> None:
    """Let the labels in a widget show text as it is written, but for those made for rich text.

    Qt guesses else: a boundary named ``<img src=...>`` would be a picture.
    """
    for label in widget.findChildren(QLabel):
        if label.textFormat() == Qt.TextFormat.AutoText:
            label.setTextFormat(Qt.TextFormat.PlainText)


LETTERS = 60
"""In a line of a tooltip."""


def wrapped(text: str) -> str:
    """Return a tooltip in lines of about 60 letters; Qt shows plain text on one line.

    Short lines stay as they are. What looks like rich text is the name of a boundary or file, and
    is shown as it is written.
    """
    short = all(len(line) <= LETTERS + 10 for line in text.splitlines())
    if short and not Qt.mightBeRichText(text):
        return text
    width = round(1.05 * LETTERS * QFontMetrics(QToolTip.font()).averageCharWidth())
    lines = html.escape(text, quote=False).replace("\n", "<br>")
    return f"<table width='{width}'><tr><td>{lines}</td></tr></table>"
