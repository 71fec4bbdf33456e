"""Whether two texts, or two pictures, say the same to a user; and if not, where they differ."""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import SequenceMatcher
from itertools import zip_longest
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter

RELATIVE, ABSOLUTE = 1e-8, 1e-11
"""Processors round differently: numbers this close are the same. Lengths of meshes are about 1."""

ROUGH = {"condition": 0.5}
"""Words that lines begin with whose numbers may be further apart: it is estimated by chance."""

DIFFERENCES = {".angle.change.": 1e-6}
"""Parts of lines whose number is a difference of larger ones, and its rounding: `RELATIVE` of
these, here angles of about 90 degrees."""

SHORT = 6
"""Significant digits from which on the last one of a printed number may be another by one."""

BLUR, NEAR, LEVELS, SPOT = 1.5, 3, 22, 6
"""Pictures are blurred by so many pixels; then a pixel differs that is darker or brighter than all
of the other picture in a square so wide around it, by more than so many of 255 levels; and so many
may. Edges and letters that are smoothed or placed in another way stay below, a number on an axis
that is missing or another does not."""

LISTED = 12
"""Lines of a difference that are told."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.\d*|\.\d+|\d+)(?:e[-+]?\d+)?(?![\w.]*[A-Za-z_])")


def difference(kept: Path, new: Path) -> str:
    """Return in words how a new file differs from the one that is kept, or nothing."""
    if kept.suffix == ".png":
        return _of_pictures(kept, new)
    return text_difference(kept.read_text("utf-8"), new.read_text("utf-8"))


def text_difference(kept: str, new: str) -> str:
    """Return the first lines that differ, with their number and the command above them."""
    before, after = kept.splitlines(), new.splitlines()
    told, command = [], ""
    for number, old, now in _pairs(before, after):
        if old is not None and old.startswith("$ "):
            command = old
        if old is None or now is None or not lines_alike(old, now):
            where = f"line {number}, under {command}" if command else f"line {number}"
            parts = [f"  {where}"]
            parts += [f"    - {old}"] if old is not None else []
            parts += [f"    + {now}"] if now is not None else []
            told.append("\n".join(parts))
    more = [f"  and {len(told) - LISTED} more"] if len(told) > LISTED else []
    return "\n".join(told[:LISTED] + more)


def _pairs(before: list[str], after: list[str]) -> Iterator[tuple[int, str | None, str | None]]:
    """Yield a line's number in the kept text, the line there, and the new one in its place."""
    if len(before) == len(after):
        for number, (old, now) in enumerate(zip(before, after, strict=True), start=1):
            yield number, old, now
        return
    words = [[_NUMBER.sub("0", line) for line in lines] for lines in (before, after)]
    for _, low, high, start, end in SequenceMatcher(None, *words, autojunk=False).get_opcodes():
        for at, (old, now) in enumerate(zip_longest(before[low:high], after[start:end])):
            yield min(low + at, high) + 1, old, now


def lines_alike(old: str, now: str) -> bool:
    """Return whether two lines have the same words, and numbers that are as good as the same."""
    if old == now:
        return True
    first, second = _NUMBER.findall(old), _NUMBER.findall(now)
    if len(first) != len(second) or not first:
        return False
    # Columns are as wide as their numbers are.
    words = (" ".join(_NUMBER.sub("#", line).split()) for line in (old, now))
    relative = ROUGH.get(old.partition(" ")[0], RELATIVE)
    absolute = max([ABSOLUTE, *(value for part, value in DIFFERENCES.items() if part in old)])
    pairs = zip(first, second, strict=True)
    same = all(numbers_alike(*pair, relative, absolute) for pair in pairs)
    return same and next(words) == next(words)


def numbers_alike(
    old: str, now: str, relative: float = RELATIVE, absolute: float = ABSOLUTE
) -> bool:
    """Return whether two numbers differ by no more than rounding; whole ones must not at all."""
    if old == now:
        return True
    if not any(set(text) & set(".e") for text in (old, now)):
        return False
    a, b = float(old), float(now)
    allowed = max(absolute, relative * max(abs(a), abs(b)))
    mantissa, _, power = old.partition("e")
    if len(mantissa.lstrip("-+0.").replace(".", "")) >= SHORT:
        unit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
        allowed = max(allowed, 1.001 * unit)
    return abs(a - b) <= allowed


def pixels_apart(kept: Image.Image, new: Image.Image) -> np.ndarray:
    """Return where two pictures of one size differ to the eye, (height, width) of bool."""
    first, second = (
        image.convert("RGB").filter(ImageFilter.BoxBlur(BLUR)) for image in (kept, new)
    )
    return np.maximum(_beyond(first, second), _beyond(second, first)) > LEVELS


def _beyond(image: Image.Image, other: Image.Image) -> np.ndarray:
    """Return how far a picture leaves what the other one has near by, (height, width)."""
    low, here, high = (
        np.asarray(shown, dtype=np.int16)
        for shown in (
            *(other.filter(ImageFilter.MinFilter(NEAR)), image),
            other.filter(ImageFilter.MaxFilter(NEAR)),
        )
    )
    return np.maximum(low - here, here - high).max(axis=2)


def picture_difference(kept: Image.Image, new: Image.Image) -> str:
    """Return in words how two pictures differ, or nothing."""
    if kept.size != new.size:
        return f"  {new.width}x{new.height} pixels instead of {kept.width}x{kept.height}"
    apart = pixels_apart(kept, new)
    if apart.sum() <= SPOT:
        return ""
    rows, columns = np.nonzero(apart)
    return (
        f"  {apart.sum()} of {apart.size} pixels differ, between column {columns.min()}, row "
        f"{rows.min()} and column {columns.max()}, row {rows.max()}"
    )


def _of_pictures(kept: Path, new: Path) -> str:
    with Image.open(kept) as old, Image.open(new) as now:
        return picture_difference(old, now)
