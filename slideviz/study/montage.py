"""The montage of a comparison: pictures of its meshes, one camera, one scale (Figure 5.9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colorbar import make_axes

from slideviz.color_scheme import COLOR_MAP
from slideviz.export.encode import Pixels
from slideviz.export.offscreen_renderer import WHITE, pictures_alike
from slideviz.mesh.model import Mesh
from slideviz.plots.cells import color_bar, color_scale
from slideviz.plots.figure_io import SMALLEST, empty_figure, fitted, trim
from slideviz.plots.style import PRINT
from slideviz.session.state import StepFrame
from slideviz.study.combinations import (
    COMPARED_METHODS,
    MODES,
    TITLES,
    CombinationRow,
    Result,
    reasons,
    words_for,
)
from slideviz.study.plots import WIDTH

GridPlace = tuple[int, int]  # row and column of a picture in the montage

DPI = 300
NOT_KEPT = "not drawn: too many large meshes; compare fewer methods or steps at once"
_OVERSAMPLED = 2
"""Ratio of drawn to shown size of pictures, so that fine mesh lines turn grey, not black."""
_NAME = 0.3
_LOWEST = 0.5
"""Inches: width of the name of a row, and the least height of a row, so that its name fits."""
_HIGHEST = 40.0  # inches: height of the figure while it is laid out; it is trimmed afterwards


def montage(rows: Sequence[CombinationRow], base: Mesh) -> Any:
    """Return the pictures of rows as a figure: a row for each method, a column for each mode.

    With many methods and few modes it is the other way round, so that the montage is not too long.
    A method or a mode without any result has no row or column; a note at the foot says why.
    Returns None where no row has a mesh.
    ``rows``: of one number of steps. Where a row has no result or no mesh, its place says so.
    ``base``: the undeformed mesh.
    """
    done = [row for row in rows if row.result is not None]
    kept = {
        id(row.result): (row.result.mesh, row.result.quality)
        for row in done
        if row.result is not None and row.result.mesh is not None
    }
    if not kept:
        return None
    methods = _axis(rows, done, "method")
    modes = _axis(rows, done, "periodic")
    places = {
        (methods[row.combination.method][0], modes[row.combination.periodic][0]): row
        for row in rows
        if row.combination.method in methods and row.combination.periodic in modes
    }
    names = [tuple(name for _, name in axis.values()) for axis in (methods, modes)]
    if len(modes) == 1 or len(methods) > 2 * len(modes):  # the methods beside each other
        names = names[::-1]
        places = {at[::-1]: row for at, row in places.items()}
    # Those of long montages are smaller.
    wide = (WIDTH - _NAME) / max(len(names[1]), 2 if len(names[0]) < 3 else 3)
    side = int(wide * DPI * _OVERSAMPLED)
    drawn = pictures_alike([StepFrame(*one) for one in kept.values()], base, side)
    images = dict(zip(kept, drawn, strict=True))
    shown = {at: images[id(row.result)] for at, row in places.items() if id(row.result) in images}
    words, notes = _words(places, rows, shown)
    figure, facets = _facets(names, shown, wide)
    for at, axes in np.ndenumerate(facets):
        row = places.get((at[0], at[1]))
        if row is not None:
            _fill(axes, words.get((at[0], at[1]), ""), row, wide)
    colors = color_scale(COLOR_MAP, (0.0, 1.0))
    _foot(figure, facets, colors, any(found.inverted for _, found in kept.values()), notes)
    return figure


def _axis(
    rows: Sequence[CombinationRow], done: Sequence[CombinationRow], what: str
) -> dict[str, tuple[int, str]]:
    """Return place and name ("" if one was asked) of each method or mode with a result."""
    words = (
        {name: title for name, (title, _) in COMPARED_METHODS.items()}
        if what == "method"
        else MODES
    )
    asked = dict.fromkeys(getattr(row.combination, what) for row in rows)
    shown = {getattr(row.combination, what) for row in done}
    left = [name for name in asked if name in shown]
    return {name: (k, words[name] if len(asked) > 1 else "") for k, name in enumerate(left)}


def _words(
    places: Mapping[GridPlace, CombinationRow],
    rows: Sequence[CombinationRow],
    shown: Mapping[GridPlace, Pixels],
) -> tuple[dict[GridPlace, str], list[str]]:
    """Return the words in places without a picture, and the notes at the foot."""
    problems = {row.combination: row.problem for row in rows if row.result is None}
    every = [row.combination for row in rows]
    sentences = list(reasons(problems).items())
    notes = [
        f"[{number}] {words_for(some, every, TITLES)}: not possible: {reason}"
        for number, (reason, some) in enumerate(sentences, start=1)
    ]
    words = {}
    for at, row in places.items():
        if row.result is None:
            number = next(k for k, (_, some) in enumerate(sentences, 1) if row.combination in some)
            words[at] = f"not possible [{number}]"
        elif at not in shown:
            words[at] = f"not drawn [{len(sentences) + 1}]"
    if any(text.startswith("not drawn") for text in words.values()):
        notes.append(f"[{len(sentences) + 1}] {NOT_KEPT}")
    return words, notes


def _facets(
    names: Sequence[Sequence[str]], shown: Mapping[GridPlace, Pixels], wide: float
) -> tuple[Any, Any]:
    """Return a figure and its axes (rows, columns), with names and pictures drawn in them."""
    across = _drawn(list(shown.values()), 1)
    width = across.stop - across.start
    down = [
        _drawn([image for at, image in shown.items() if at[0] == row] or list(shown.values()), 0)
        for row in range(len(names[0]))
    ]
    # What is missing is white, so that the name of the row has room beside it.
    heights = [max(part.stop - part.start, _LOWEST / wide * width) for part in down]
    size = _NAME + len(names[1]) * wide, _HIGHEST
    figure = empty_figure(size, 100.0, "compressed")
    shape = len(names[0]), len(names[1])
    facets = figure.subplots(*shape, squeeze=False, gridspec_kw={"height_ratios": heights})
    for (row, column), axes in np.ndenumerate(facets):
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        image = shown.get((row, column))
        if image is not None:
            axes.imshow(image[down[row], across], interpolation="antialiased")
        half = heights[row] / 2.0
        middle = (down[row].stop - down[row].start) / 2.0
        axes.set(aspect="equal", xlim=(0, width), ylim=(middle + half, middle - half))
        if row == 0:
            axes.set_title(fitted(names[1][column], wide, PRINT.size)[0], fontsize=PRINT.size)
        if column == 0:
            high = wide * heights[row] / width
            axes.set_ylabel(fitted(names[0][row], high, SMALLEST)[0], fontsize=PRINT.size)
    return figure, facets


def _drawn(images: Sequence[Pixels], axis: int) -> slice:
    """Return the slice of rows (axis 0) or columns (axis 1) where any image is not white."""
    some = np.zeros(images[0].shape[axis], bool)
    for image in images:
        some |= (image < WHITE).any(axis=(1 - axis, 2))
    indices = np.flatnonzero(some)
    return slice(int(indices[0]), int(indices[-1]) + 1) if len(indices) else slice(0, len(some))


def _fill(axes: Any, words: str, row: CombinationRow, wide: float) -> None:
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALLEST, "color": "0.35"}
    axes.text(0.5, 0.5, fitted(words, wide, SMALLEST)[0], transform=axes.transAxes, **style)
    if row.result is not None:
        axes.set_xlabel(fitted(_numbers(row.result), wide, SMALLEST)[0], fontsize=SMALLEST)


def _numbers(result: Result) -> str:
    measured = result.quality
    text = f"min {measured.min:.3f}, mean {measured.mean:.3f}"
    return f"{text}\n{measured.inverted} inverted" if measured.inverted else text


def _foot(figure: Any, facets: Any, colors: Any, inverted: bool, notes: Sequence[str]) -> None:
    """Draw one color bar for all facets and write the notes below it; trim the figure."""
    if notes:
        width = figure.get_size_inches()[0]
        sentence = fitted("\n".join(notes), width - 0.2, SMALLEST)[0]
        figure.supxlabel(sentence, x=0.1 / width, ha="left", fontsize=SMALLEST)
    place, _ = make_axes(facets.ravel().tolist(), location="bottom", shrink=0.6, aspect=30)
    color_bar(place, colors, "size-skew quality [-]", SMALLEST, inverted=inverted, upright=False)
    trim(figure, [*facets, [place]])
