"""What the sections panel calls sections, and what its buttons do with them."""

from __future__ import annotations

from typing import NamedTuple

from slideviz.terms import SECTION_KINDS

HINTS = {
    3: "Cut the mesh with a plane, or with a cylinder that can be unrolled, to see its cells "
    "inside.",
    2: "Lay a line or a circle through the mesh to see the cells on it, and their quality along "
    "it.",
}
NAMES = {
    3: tuple(term.label for term in SECTION_KINDS.values()),
    2: tuple(term.in_2d for term in SECTION_KINDS.values()),
}
"""What sections are called, by the dimensions of the mesh."""
UNSEEN = "Tick the section in the list to show it."


class Tips(NamedTuple):
    """What a handle, the flat view and the button to look do."""

    handle: str
    flat: str
    look: str = ""


CURVE = "Show the quality of the cells along the section beside the view."
TIPS = {
    "plane": Tips(
        "Drag the plane in the view: its face moves it, the arrow turns it.",
        "Show the section along its normal beside the 3D view.",
        "Look along the normal.",
    ),
    "cylinder": Tips(
        "Drag the ball in the view to change the radius.",
        "Show the cylinder unrolled to axis and r θ beside the 3D view.",
        "Look at the cylinder from outside, at the middle of what it cuts.",
    ),
    "line": Tips(
        "Drag the line in the view: itself or its middle moves it, its ends turn it.", CURVE
    ),
    "circle": Tips(
        "Drag the circle in the view: its middle moves it, itself changes the radius.", CURVE
    ),
}
