"""Figures of matplotlib: made empty, trimmed, and written; the one place that says how."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from slideviz.errors import CaseError, SlidevizError
from slideviz.mesh.io.atomic import atomic_write

SETTINGS = {
    # Names that are not random: the same figure gives the same file.
    "svg.hashsalt": "slideviz",
    # TrueType; journals refuse the Type 3 fonts that matplotlib writes otherwise.
    "pdf.fonttype": 42,
}

_AIR = 0.08
"""Inches between the parts of a figure, and around them."""
SMALLEST = 8.0
"""Points; no letter is smaller at the printed size."""


def empty_figure(inches: tuple[float, float], dpi: float, layout: str = "none") -> Any:
    """Return an empty white figure, whose parts matplotlib lays out as ``layout`` says."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=inches, dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    lay_out(figure, layout)
    return figure


def lay_out(figure: Any, layout: str) -> None:
    """Let matplotlib lay out the parts of a figure: "constrained", "compressed" or "none"."""
    figure.set_layout_engine(layout)
    if layout != "none":
        figure.get_layout_engine().set(h_pad=_AIR / 2.0, w_pad=_AIR / 2.0, hspace=0.0)


def trim(figure: Any, rows: Sequence[Sequence[Any]]) -> None:
    """Make a figure no higher than its words and rows of axes are when they are laid out."""
    from matplotlib.transforms import Bbox

    figure.draw_without_rendering()
    boxes = [Bbox.union([axes.get_tightbbox() for axes in row]) for row in rows]
    boxes += [text.get_window_extent() for text in figure.texts]
    width, height = figure.get_size_inches()
    needed = sum(box.height for box in boxes) / figure.dpi + _AIR * (len(boxes) + 1)
    figure.set_size_inches(width, min(needed, height))


def fitted(words: str, inches: float, size: float) -> tuple[str, float]:
    """Return words broken to fit a width of so many inches, and the size of their letters.

    They are up to ``size`` points high, smaller where a line is too long, and where it is so even
    with the smallest ones, in more lines.
    """
    from matplotlib.textpath import TextPath

    room, found = 72.0 * inches, []
    widths = {
        line: float(TextPath((0.0, 0.0), line, size=1.0).get_extents().width)
        for line in words.split("\n")
        if line.strip()
    }
    size = min(size, max(room / max(widths.values(), default=1.0), SMALLEST))
    for line in words.split("\n"):
        lines = math.ceil(widths.get(line, 0.0) * size / room - 1e-9)
        # Of several lines one has more of the wide letters than another.
        most = int(0.93 * len(line) * room / (widths[line] * size)) if lines > 1 else len(line)
        found += textwrap.wrap(line, max(most, 8)) or [""]
    return "\n".join(found), size


def figure_bytes(figure: Any, kind: str, dpi: float = 300.0, transparent: bool = False) -> bytes:
    """Return a matplotlib figure as the content of a file.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    kind : "png", "svg" or "pdf"
    dpi : float
        Pixels per inch, in PDF and SVG of what cannot be drawn with lines.
    transparent : bool
        Whether the background is left out.
    """
    from matplotlib import rc_context

    data = BytesIO()
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with rc_context(SETTINGS):  # type: ignore[arg-type]  # keys are names
        figure.savefig(data, format=kind, dpi=dpi, metadata=metadata, transparent=transparent)
    return data.getvalue()


def write_figure(
    figure: Any,
    file: Path,
    dpi: float = 300.0,
    error: type[SlidevizError] = CaseError,
    transparent: bool = False,
) -> None:
    """Write a figure as the end of the file's name says, whole or not at all.

    Raises
    ------
    SlidevizError
        The file cannot be written; of the class ``error``.
    """
    data = figure_bytes(figure, file.suffix.lower()[1:], dpi, transparent)
    with atomic_write(file, error) as out:
        out.write(data)
