"""Keys of a case file about the view of the window; runs without a window ignore them.

Their values are in ``Case.view``, by key; `slideviz.session.saving` makes a view of them and back.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.case.key import VIEW, Key
from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.case.values import NAMES, Kind, choice, integer, vector_text
from slideviz.case.words import list_of, number
from slideviz.errors import CaseError, shown
from slideviz.terms import COLOR_BY, COLOR_MAPS, POINTS_SHOWN, SHOWN

if TYPE_CHECKING:
    from slideviz.case.model import Case

HIDDEN = "hidden"  # the last word of a section that is not drawn

SectionText = tuple[str, tuple[float, ...], bool, bool, bool]
"""A section: shape, numbers, whether whole cells are shown, has a flat view, and is drawn."""


def numbers(count: int, allowed: str, rising: bool = False, more: int = 0) -> Kind:
    """Return the kind of ``count`` to ``count + more`` numbers; with ``rising`` each larger."""

    def read(text: str) -> tuple[float, ...]:
        values = tuple(number(item.text) for item in list_of(text))
        if not count <= len(values) <= count + more:
            raise CaseError(f"{shown(text)} has {len(values)} numbers; expected {allowed}")
        if rising and any(a >= b for a, b in pairwise(values)):
            raise CaseError(f"{shown(text)} does not rise; expected {allowed}")
        return values

    return Kind(allowed, read, vector_text)


def words(known: tuple[str, ...]) -> Kind:
    """Return the kind of a list of words out of ``known``; it is read in the order of these."""
    allowed = f"a list of {', '.join(known)}"

    def read(text: str) -> tuple[str, ...]:
        words = [item.text.lower() for item in list_of(text)]
        for word in words:
            if word not in known:
                raise CaseError(f"{shown(word)} is not one of {', '.join(known)}")
        return tuple(word for word in known if word in words)

    return Kind(allowed, read, lambda value: f"( {', '.join(value)} )")


def read_sections(text: str) -> tuple[SectionText, ...]:
    """Return the sections of the value of ``VIEW_SECTIONS``; CaseError if one has another form."""
    sections = []
    for place, part in enumerate((p for p in text.split(";") if p.strip(" ()")), start=1):
        items = [item.text for item in list_of(part.strip())]
        form = items[0].lower() if items else ""
        drawn = items[-1].lower() != HIDDEN if items else True
        if not drawn:
            items.pop()
        shape = SECTION_SHAPES.get(form)
        word = "flat" if shape is None else shape.flat
        flat = bool(items) and items[-1].lower() == word and shape is not None
        if flat:
            items.pop()
        how = items[-1].lower() if items else ""
        if shape is None or how not in ("whole", "cut"):
            raise CaseError(
                f"section {place}: {shown(part.strip())} does not begin with {names()} and end "
                f"with whole or cut, and after that {word}, {HIDDEN} or nothing"
            )
        values = tuple(number(item) for item in items[1:-1])
        if len(values) != shape.count:
            raise CaseError(
                f"section {place}: a {form} has {shape.count} numbers, {len(values)} are given"
            )
        if not np.linalg.norm(values[-6:-3]) > 0:
            raise CaseError(f"section {place}: its direction has no length")
        fault = shape.size.fault(values[0]) if shape.size is not None else ""
        if fault and shape.size is not None:
            raise CaseError(f"section {place}: the {shape.size.word} {values[0]:g} {fault}")
        sections.append((form, values, how == "whole", flat, drawn))
    return tuple(sections)


def write_sections(sections: tuple[SectionText, ...]) -> str:
    """Return the value of ``VIEW_SECTIONS`` that ``read_sections`` reads back, without loss."""
    texts = []
    for form, values, whole_cells, flat, drawn in sections:
        words = [form, *(repr(float(v)) for v in values), "whole" if whole_cells else "cut"]
        if flat:
            words.append(SECTION_SHAPES[form].flat)
        if not drawn:
            words.append(HIDDEN)
        texts.append(f"({', '.join(words)})")
    return " ; ".join(texts) or "( )"


SECTIONS = Kind(
    "(form, numbers, whole | cut) ; ...",
    read_sections,
    write_sections,
    details=(
        *(
            f"({shape.value}, {shape.numbers}, whole | cut): {shape.meaning}"
            for shape in SECTION_SHAPES.values()
        ),
        "after that flat (plane) or unrolled (others): laid flat beside the view",
        "at the very end hidden: kept, but not drawn",
    ),
)


def hyphened(shown: str) -> str:
    """Return the word of VIEW_SHOW for a value of ``Shown``: hyphens instead of underscores."""
    return shown.replace("_", "-")


def _row(name: str, kind: Kind, meaning: str) -> Key:
    def put(case: Case, value: Any) -> Case:
        return case.change(view={**case.view, name: value})

    return Key(name, VIEW, kind, meaning, put, lambda case: case.view.get(name))


VIEW_ROWS = (
    _row("VIEW_COLOR", choice({w: w for w in COLOR_BY}), "What the colors show."),
    _row("VIEW_RANGE", numbers(2, "two rising numbers", True), "Ends of the color bar."),
    _row("VIEW_MAP", choice({w: w for w in COLOR_MAPS}), "The color map."),
    _row("VIEW_THRESHOLD", numbers(2, "two rising numbers", True), "Only cells between them."),
    _row("VIEW_POINTS", choice({w: w for w in POINTS_SHOWN}), "Nodes drawn as points."),
    _row("VIEW_SHOW", words(tuple(map(hyphened, SHOWN))), "What is drawn beside the boundaries."),
    _row("VIEW_COPIES", integer(-1), "Passages drawn on each side; -1 draws all."),
    _row("VIEW_HIDDEN", NAMES, "Boundaries that are not drawn."),
    _row("VIEW_SECTIONS", SECTIONS, f"Sections of the mesh, each by a {names()}."),
    _row(
        "VIEW_CAMERA",
        numbers(10, "ten or eleven numbers", more=1),
        "Position of the camera, the point that it looks at, its upward direction, and half the "
        "height of the view; then width over height of the view, for a narrower one.",
    ),
)
