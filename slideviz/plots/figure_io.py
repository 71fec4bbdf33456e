"""Make empty matplotlib figures, trim them, fit texts, and write files, the same way everywhere."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath
from matplotlib.transforms import Bbox

from slideviz.errors import CaseError, SlidevizError
from slideviz.system.atomic import write_whole

SETTINGS = {
    # Names that are not random: the same figure gives the same file.
    "svg.hashsalt": "slideviz",
    # TrueType; journals refuse the Type 3 fonts that matplotlib writes otherwise.
    "pdf.fonttype": 42,
}
"""matplotlib's settings while a figure is written."""

_AIR = 0.08  # space in inches between the parts of a figure, and around them
SMALLEST = 8.0  # smallest size of letters in points, at the printed size


def empty_figure(inches: tuple[float, float], dpi: float, layout: str = "none") -> Any:
    """Return an empty white figure with a layout engine (see `lay_out`)."""
    figure = Figure(figsize=inches, dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    lay_out(figure, layout)
    return figure


def lay_out(figure: Any, layout: str) -> None:
    """Set a figure's layout engine: "constrained", "compressed" or "none"."""
    figure.set_layout_engine(layout)
    if layout != "none":
        figure.get_layout_engine().set(h_pad=_AIR / 2.0, w_pad=_AIR / 2.0, hspace=0.0)


def trim(figure: Any, rows: Sequence[Sequence[Any]]) -> None:
    """Reduce a figure's height to that of its texts and rows of axes as laid out."""
    figure.draw_without_rendering()
    boxes = [Bbox.union([axes.get_tightbbox() for axes in row]) for row in rows]
    boxes += [text.get_window_extent() for text in figure.texts]
    width, height = figure.get_size_inches()
    needed = sum(box.height for box in boxes) / figure.dpi + _AIR * (len(boxes) + 1)
    figure.set_size_inches(width, min(needed, height))


def fitted(words: str, inches: float, size: float) -> tuple[str, float]:
    """Return a text that fits a width in inches, and the size of its letters in points.

    The size is at most ``size``, smaller if a line is too long, and not below `SMALLEST`; lines
    still too long are wrapped.
    """
    points = 72.0 * inches
    wrapped = []
    widths = {
        line: float(TextPath((0.0, 0.0), line, size=1.0).get_extents().width)
        for line in words.split("\n")
        if line.strip()
    }
    size = min(size, max(points / max(widths.values(), default=1.0), SMALLEST))
    for line in words.split("\n"):
        lines = math.ceil(widths.get(line, 0.0) * size / points - 1e-9)
        # With a margin, as some of the wrapped lines have more wide letters than others.
        most = int(0.93 * len(line) * points / (widths[line] * size)) if lines > 1 else len(line)
        wrapped += textwrap.wrap(line, max(most, 8)) or [""]
    return "\n".join(wrapped), size


def figure_bytes(figure: Any, kind: str, dpi: float = 300.0, transparent: bool = False) -> bytes:
    """Return the content of a file with a matplotlib figure.

    ``dpi``: pixels per inch; in PDF and SVG of the parts that are drawn as pixels. ``transparent``:
    whether the background is transparent.
    """
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
    """Write a figure to a PNG, SVG or PDF file, by its suffix, whole or not at all.

    Raises an error of the class ``error`` if the file cannot be written.
    """
    data = figure_bytes(figure, file.suffix.lower()[1:], dpi, transparent)
    write_whole(file, data, error)
