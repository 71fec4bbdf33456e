"""Quality pictures of a comparison side by side: one camera, one scale (thesis Figure 5.9)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.view.compare import METHODS, MODES, Result, Row
from slideviz.view.compare_plots import WIDTH
from slideviz.view.look import COLOUR_MAP, INVERTED_COLOUR
from slideviz.view.offscreen import image_of, offscreen
from slideviz.view.plots_style import PRINT, SMALLEST
from slideviz.view.portrait import Portrait
from slideviz.view.state import Frame
from slideviz.view.surfaces import padded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Image = NDArray[np.uint8]

DPI = 300
NOT_KEPT = "not drawn: too many large meshes; compare fewer methods or steps at once"
_WHITE = 250
_OVERSAMPLED = 2
"""Pictures are drawn so much larger than shown, so that fine mesh lines turn grey, not black."""
_SMALL = 10
"""Pixels: cells smaller than this, on average, are drawn without edges."""
_WORDS = 0.42
"""Inches below a picture for its numbers."""
_BAR = 1.0
"""Inches for titles and the colour bar."""


def sheet(rows: Sequence[Row], base: Mesh) -> Figure | None:
    """Return the pictures of rows, a row for each method and a column for each periodic mode.

    Parameters
    ----------
    rows : sequence of Row
        Of one number of steps. Where a row has no result or no mesh, its place says why.
    base : Mesh
        The undeformed mesh.

    Returns
    -------
    Figure or None
        None where no row has a mesh.
    """
    methods = list(dict.fromkeys(row.combination.method for row in rows))
    modes = list(dict.fromkeys(row.combination.periodic for row in rows))
    done = {
        id(row.result): (row.result.mesh, row.result.quality)
        for row in rows
        if row.result is not None and row.result.mesh is not None
    }
    if not done:
        return None
    beside, above = [METHODS[name][0] for name in methods], [MODES[name] for name in modes]
    places = {
        (methods.index(row.combination.method), modes.index(row.combination.periodic)): row
        for row in rows
    }
    if len(modes) == 1:  # the methods beside each other instead of below
        beside, above = above, beside
        places = {at[::-1]: row for at, row in places.items()}
    images = _images(list(done.values()), base, WIDTH / max(len(above), 2))
    figure = _composed((beside, above), places, dict(zip(done, images, strict=True)))
    _colour_bar(figure, any(found.inverted for _, found in done.values()))
    return figure


def _images(results: Sequence[tuple[Mesh, Quality]], base: Mesh, inches: float) -> list[Image]:
    """Return a picture of each mesh, all seen by the same camera."""
    side = int(inches * DPI * _OVERSAMPLED)
    with offscreen((side, side)) as plotter:
        portrait = Portrait(plotter, results[0][0], base)
        if portrait.detail is None:
            _fit(plotter, [base, *(mesh for mesh, _ in results)])
        shown = list(plotter.actors.values())
        images: list[Image] = []
        for mesh, found in results:
            portrait.show(Frame(mesh, found))
            for name in list(plotter.scalar_bars.keys()):
                plotter.remove_scalar_bar(name, render=False)
            if not images and _crowded(image_of(plotter), shown):
                for actor in shown:
                    actor.prop.show_edges = False
            images.append(image_of(plotter))
    return images


def _crowded(image: Image, actors: Sequence[Any]) -> bool:
    """Tell whether cells are so small that their edges would hide their colours."""
    cells = sum(actor.mapper.dataset.n_cells for actor in actors)
    return int((image < _WHITE).any(axis=2).sum()) < cells * _SMALL**2


def _fit(plotter: Any, meshes: Sequence[Mesh]) -> None:
    """Let the camera see all meshes, in the middle of the picture."""
    low = np.min([padded(mesh.points).min(axis=0) for mesh in meshes], axis=0)
    high = np.max([padded(mesh.points).max(axis=0) for mesh in meshes], axis=0)
    plotter.camera.SetWindowCenter(0.0, 0.0)
    plotter.renderer.ResetCameraScreenSpace(np.stack([low, high], axis=1).ravel(), 0.98)
    plotter.renderer.ResetCameraClippingRange()


def _drawn(images: Sequence[Image], axis: int) -> slice:
    """Return where any of the images is not white: rows for axis 0, columns for axis 1."""
    some = np.zeros(images[0].shape[axis], bool)
    for image in images:
        some |= (image < _WHITE).any(axis=(1 - axis, 2))
    found = np.flatnonzero(some)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, len(some))


def _composed(
    names: tuple[Sequence[str], Sequence[str]],
    places: Mapping[tuple[int, int], Row],
    images: Mapping[int, Image],
) -> Figure:
    """Return a figure with the pictures in their places."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shape = len(names[0]), len(names[1])
    columns = _drawn(list(images.values()), 1)
    # One scale for all; a row of pictures is only as high as it must be.
    rows = [
        _drawn(
            [
                images[id(row.result)]
                for at, row in places.items()
                if at[0] == k and id(row.result) in images
            ]
            or list(images.values()),
            0,
        )
        for k in range(shape[0])
    ]
    tile = WIDTH / max(shape[1], 2)
    inches = 0.94 * tile / (columns.stop - columns.start)  # the rest is between the pictures
    tall = [inches * (row.stop - row.start) + _WORDS for row in rows]
    figure = Figure(figsize=(tile * shape[1], sum(tall) + _BAR), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(*shape, squeeze=False, height_ratios=tall)
    for at, axes in np.ndenumerate(grid):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        _name(axes, at, names)
        row = places.get(at)
        if row is None:
            continue
        if row.result is not None:
            axes.set_xlabel(_numbers(row.result), fontsize=SMALLEST)
        if id(row.result) in images:
            image = images[id(row.result)][rows[at[0]], columns]
            axes.imshow(image, interpolation="antialiased")
        else:
            blank = np.full((rows[at[0]].stop - rows[at[0]].start, columns.stop - columns.start), 1)
            axes.imshow(blank, cmap="gray", vmin=0, vmax=1)
            _say(axes, row, max(12, int(tile * 11)))
    return figure


def _say(axes: Any, row: Row, letters: int) -> None:
    """Write why there is no picture, in lines of so many letters."""
    words = NOT_KEPT if row.result is not None else f"not possible: {row.problem}"
    lines = textwrap.fill(textwrap.shorten(words, 150, placeholder=" ..."), letters)
    place = {"ha": "center", "va": "center", "transform": axes.transAxes}
    axes.text(0.5, 0.5, lines, fontsize=SMALLEST, **place)


def _numbers(result: Result) -> str:
    found = result.quality
    text = f"min {found.min:.3f}, mean {found.mean:.3f}"
    return f"{text}\n{found.inverted} inverted" if found.inverted else text


def _name(axes: Any, at: tuple[int, int], names: tuple[Sequence[str], Sequence[str]]) -> None:
    """Write the name of a column above it, and that of a row beside it."""
    beside, above = names
    if at[0] == 0 and len(above) > 1:
        axes.set_title(above[at[1]], fontsize=PRINT.size)
    if at[1] == 0 and len(beside) > 1:
        axes.set_ylabel(beside[at[0]], fontsize=PRINT.size)


def _colour_bar(figure: Figure, inverted: bool) -> None:
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = mpl.colormaps[COLOUR_MAP].with_extremes(under=INVERTED_COLOUR)
    bar = figure.colorbar(
        ScalarMappable(Normalize(0.0, 1.0), colours),
        ax=figure.axes,
        location="bottom",
        extend="min" if inverted else "neither",
        shrink=0.6,
        aspect=36,
        pad=0.02,
    )
    words = "size-skew quality [-]"
    bar.set_label(f"inverted cells: red;  {words}" if inverted else words, fontsize=PRINT.size)
    bar.ax.tick_params(labelsize=SMALLEST)
