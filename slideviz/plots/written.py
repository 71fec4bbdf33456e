"""Figures as files: the one place that says how PDF, SVG and PNG are written."""

from __future__ import annotations

from io import BytesIO
from typing import Any

SETTINGS = {
    # Names that are not random: the same figure gives the same file.
    "svg.hashsalt": "slideviz",
    # TrueType; journals refuse the Type 3 fonts that matplotlib writes otherwise.
    "pdf.fonttype": 42,
}


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
    with rc_context(SETTINGS):
        figure.savefig(data, format=kind, dpi=dpi, metadata=metadata, transparent=transparent)
    return data.getvalue()
