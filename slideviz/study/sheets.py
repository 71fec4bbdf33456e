"""Quality pictures of a comparison side by side: one camera, one scale (thesis Figure 5.9)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from slideviz.export.picture import pictures_alike
from slideviz.mesh.model import Mesh
from slideviz.session.state import Frame
from slideviz.study.combinations import METHODS, MODES, Result, Row
from slideviz.study.page import Image, Page, Place, compose, tile_width
from slideviz.study.wanted import TITLES, reasons, words_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 300
NOT_KEPT = "not drawn: too many large meshes; compare fewer methods or steps at once"
_OVERSAMPLED = 2
"""Pictures are drawn so much larger than shown, so that fine mesh lines turn grey, not black."""


def sheet(rows: Sequence[Row], base: Mesh) -> Figure | None:
    """Return the pictures of rows, a row for each method and a column for each periodic mode.

    Of many methods and few modes it is the other way round, so that the page is not too long.
    A method or a mode that could not be computed at all has no place; the foot says why.

    Parameters
    ----------
    rows : sequence of Row
        Of one number of steps. Where a row has no result or no mesh, its place says so.
    base : Mesh
        The undeformed mesh.

    Returns
    -------
    Figure or None
        None where no row has a mesh.
    """
    done = [row for row in rows if row.result is not None]
    kept = {
        id(row.result): (row.result.mesh, row.result.quality)
        for row in done
        if row.result is not None and row.result.mesh is not None
    }
    if not kept:
        return None
    methods, modes = _axis(rows, done, "method"), _axis(rows, done, "periodic")
    places = {
        (methods[row.combination.method][0], modes[row.combination.periodic][0]): row
        for row in rows
        if row.combination.method in methods and row.combination.periodic in modes
    }
    names = [tuple(name for _, name in axis.values()) for axis in (methods, modes)]
    if len(modes) == 1 or len(methods) > 2 * len(modes):  # the methods beside each other
        names, places = names[::-1], {at[::-1]: row for at, row in places.items()}
    side = int(tile_width(len(names[0]), len(names[1])) * DPI * _OVERSAMPLED)
    drawn = pictures_alike([Frame(*one) for one in kept.values()], base, side)
    images = dict(zip(kept, drawn, strict=True))
    inverted = any(found.inverted for _, found in kept.values())
    return compose(_page((names[0], names[1]), places, rows, images, inverted))


def _axis(rows: Sequence[Row], done: Sequence[Row], what: str) -> dict[str, tuple[int, str]]:
    """Return place and name of each method, or mode, of which there is a result.

    The name is empty where no other was asked for.
    """
    words = {name: title for name, (title, _) in METHODS.items()} if what == "method" else MODES
    asked, shown = (
        dict.fromkeys(getattr(row.combination, what) for row in group) for group in (rows, done)
    )
    left = [name for name in asked if name in shown]
    return {name: (k, words[name] if len(asked) > 1 else "") for k, name in enumerate(left)}


def _page(
    names: tuple[tuple[str, ...], tuple[str, ...]],
    places: Mapping[Place, Row],
    rows: Sequence[Row],
    images: Mapping[int, Image],
    inverted: bool,
) -> Page:
    """Return what is where on the page, and the notes at its foot."""
    problems = {row.combination: row.problem for row in rows if row.result is None}
    every = [row.combination for row in rows]
    told = list(reasons(problems).items())
    notes = [
        f"[{number}] {words_for(some, every, TITLES)}: not possible: {reason}"
        for number, (reason, some) in enumerate(told, start=1)
    ]
    words = {}
    for at, row in places.items():
        if row.result is None:
            number = next(k for k, (_, some) in enumerate(told, 1) if row.combination in some)
            words[at] = f"not possible [{number}]"
        elif id(row.result) not in images:
            words[at] = f"not drawn [{len(told) + 1}]"
    if any(text.startswith("not drawn") for text in words.values()):
        notes.append(f"[{len(told) + 1}] {NOT_KEPT}")
    return Page(
        rows=names[0],
        columns=names[1],
        images={at: images[id(row.result)] for at, row in places.items() if at not in words},
        numbers={at: _numbers(row.result) for at, row in places.items() if row.result is not None},
        words=words,
        notes=tuple(notes),
        inverted=inverted,
    )


def _numbers(result: Result) -> str:
    found = result.quality
    text = f"min {found.min:.3f}, mean {found.mean:.3f}"
    return f"{text}\n{found.inverted} inverted" if found.inverted else text
