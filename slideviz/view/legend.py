"""What the colours mean: the roles, or the colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slideviz.case.model import Role
from slideviz.view.look import ROLE_COLOURS, Look


def add_role_legend(plotter: Any, roles: Sequence[Role], look: Look, font_scale: float) -> None:
    """Write the roles in use into the upper right corner, each with its colour."""
    if not roles:
        return
    width, height = plotter.window_size
    # The legend's box is given in parts of the view; its letters follow from the box.
    high = min(0.4, 24 * font_scale * len(roles) / max(height, 1))
    wide = min(0.4, 110 * font_scale / max(width, 1))
    legend = plotter.add_legend(
        [[role, ROLE_COLOURS[role]] for role in roles],
        bcolor=look.background,
        background_opacity=0.75,
        border=False,
        size=(wide, high),
        loc="upper right",
        face="rectangle",
        font_family="arial",
    )
    legend.GetEntryTextProperty().SetColor(*_rgb(look.text))


def add_colour_bar(
    plotter: Any, mapper: Any, title: str, inverted: bool, style: tuple[Look, float]
) -> None:
    """Draw the colour bar of 0 to 1 at the right edge, with ``inverted`` below when there are."""
    look, font_scale = style
    bar = plotter.add_scalar_bar(
        title=title,
        mapper=mapper,
        n_labels=6,
        fmt="%.1f",
        vertical=True,
        interactive=False,
        color=look.text,
        title_font_size=int(17 * font_scale),
        label_font_size=int(15 * font_scale),
        font_family="arial",
        below_label="inverted" if inverted else None,
        position_x=0.885,
        position_y=0.12,
        width=0.085,
        height=0.76,
        unconstrained_font_size=True,
        render=False,
    )
    bar.SetUnconstrainedFontSize(True)


def _rgb(colour: str) -> tuple[float, float, float]:
    import pyvista as pv

    return pv.Color(colour).float_rgb
