"""The study's main figures, small enough for the README."""

from __future__ import annotations

from pathlib import Path

from slideviz.gui.shots import shrink

WIDTH = 1000
"""Pixels; somewhat more than a page shows, so that letters stay sharp."""

FIGURES = {
    "study-quality.png": "square/quality_20_steps.png",  # thesis Figures 5.2, 5.6, 5.9
    "study-steps.png": "square/steps.png",  # 5.1, 5.5, 5.7, 5.8
    "study-convergence.png": "dense/figure_5.21.png",
    "study-span.png": "stator/spanwise_01_steps.png",  # 6.19
}
"""Names of the pictures, and the figures they are made of."""


def publish(output: Path, folder: Path) -> list[Path]:
    """Write the main figures of a finished study into a folder, and return them."""
    from PIL import Image

    made = []
    for name, figure in FIGURES.items():
        with Image.open(output / figure) as image:
            drawn = image.convert("RGB")
        width = min(WIDTH, drawn.width)
        size = width, round(drawn.height * width / drawn.width)
        made.append(folder / name)
        drawn.resize(size, Image.Resampling.LANCZOS).save(made[-1])
        shrink(made[-1])
    return made
