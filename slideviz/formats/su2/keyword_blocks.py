"""The keyword lines of an SU2 file (``KEY= value``), and the zones they divide it into.

A section is a keyword line with all lines up to the next keyword line. Lines are counted from 0.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches

from slideviz.errors import MeshError
from slideviz.formats.su2 import KEYWORD
from slideviz.formats.su2.lines import Lines, show

_KEY = re.compile(rb"[A-Za-z_]\w*")
_COUNT = re.compile(rb"\+?\d{1,18}")
"""The value of a key that counts."""
KNOWN = ("NZONE", "IZONE", "NDIME", "NELEM", "NPOIN", "NMARK", "MARKER_TAG", "MARKER_ELEMS")
"""Keys of the sections that slideviz reads; all others are copied as they are."""
ALIASES = {"MARKERTAG": "MARKER_TAG"}
"""Other spellings of keys that SU2 reads."""


def is_ffd(text: bytes) -> bool:
    """Return whether a section (its text or key) is of boxes for free-form deformation."""
    return text.lstrip()[:14].upper().startswith((b"FFD_", b"BSPLINE_ORDER_"))


@dataclass(frozen=True)
class KeywordBlock:
    """A section: key (in capitals) and value, its keyword line, and the next one ``stop``.

    For the last section ``stop`` is the number of lines of the file. ``spelt`` is the key as the
    file has it (in capitals), which `ALIASES` may have.
    """

    key: str
    value: bytes
    line: int
    stop: int
    spelt: str = ""


@dataclass(frozen=True)
class Bounds:
    """The lines ``begin:end``, without ``IZONE``, of zone ``number`` (from 1) of ``zones``."""

    number: int
    zones: int
    begin: int
    end: int


def find_blocks(lines: Lines) -> list[KeywordBlock]:
    """Return all sections of the file, in order."""
    heads = []
    for index in lines.firsts[:-1][lines.kinds == KEYWORD].tolist():
        key, _, value = lines.line(index).partition(b"=")
        if _KEY.fullmatch(key.strip()):
            spelt = key.strip().decode().upper()
            heads.append((ALIASES.get(spelt, spelt), value.strip(), index, spelt))
    stops = [line for _, _, line, _ in heads] + [len(lines)]
    return [
        KeywordBlock(key, value, line, stop, spelt)
        for (key, value, line, spelt), stop in zip(heads, stops[1:], strict=True)
    ]


def find_bounds(lines: Lines, sections: list[KeywordBlock], number: int | None) -> Bounds:
    """Return the lines of a zone.

    Raises MeshError if this is no SU2 mesh, there is no such zone, or the zones are not numbered 1,
    2, and so on. ``number``: the zone, from 1; None for the first.
    """
    if not any(section.key in KNOWN for section in sections):
        raise MeshError(
            f"{lines.name}: this is no SU2 mesh, for it has none of NDIME=, NELEM= and NPOIN=; "
            "choose the mesh file, or give the file the ending of its format"
        )
    heads = _zone_heads(lines, sections)
    zones = max(len(heads), 1)
    chosen = 1 if number is None else number
    if not 1 <= chosen <= zones:
        has = "one zone" if zones == 1 else f"the zones 1 to {zones}"
        raise MeshError(
            f"{lines.name}: there is no zone {chosen}, for the file has {has}; choose one of these"
        )
    if zones == 1:
        return Bounds(chosen, zones, 0, len(lines))
    begin = heads[chosen].line
    later = [head.line for head in heads.values() if head.line > begin]
    return Bounds(chosen, zones, begin + 1, min(later, default=len(lines)))


def boxes_elsewhere(sections: list[KeywordBlock], bounds: Bounds) -> dict[str, int]:
    """Return the zone of each FFD box, by name, in other zones than that of ``bounds``."""
    found, zone = {}, 1
    for section in sections:
        if section.key == "IZONE":
            zone = int(section.value.split()[0])
        elif section.key == "FFD_TAG" and zone != bounds.number and bounds.zones > 1:
            found[section.value.decode("utf-8", "replace")] = zone
    return found


def _zone_heads(lines: Lines, sections: list[KeywordBlock]) -> dict[int, KeywordBlock]:
    """Return the ``IZONE`` section of each zone by number; empty if the file has no zones.

    Raises MeshError if ``NZONE`` and the ``IZONE`` lines contradict each other.
    """
    totals = [s for s in sections if s.key == "NZONE"]
    heads: dict[int, KeywordBlock] = {}
    for section in sections:
        if section.key != "IZONE":
            continue
        number = count_of(lines, section)
        if number in heads:
            raise lines.error(
                section.line,
                f"IZONE= {number} stands a second time (first on line {heads[number].line + 1}); "
                "number the zones one by one",
            )
        heads[number] = section
    if not totals:
        if len(heads) > 1:
            second = list(heads.values())[1]
            raise lines.error(
                second.line,
                f"a second zone begins, but there is no NZONE; put NZONE= {len(heads)} on the "
                "first line",
            )
        return {}
    total = count_of(lines, totals[0])
    if total == 1 and not heads:
        return {}
    if sorted(heads) != list(range(1, len(heads) + 1)) or len(heads) != total:
        present = ", ".join(map(str, list(heads)[:8])) or "none"
        raise lines.error(
            totals[0].line,
            f"NZONE= {total} needs the lines IZONE= 1 to IZONE= {total}, each once, but the file "
            f"has {present}; correct NZONE or restore the missing zone",
        )
    return heads


def misspelt(sections: list[KeywordBlock], key: str) -> str:
    """Return the words for a message that an unknown keyword may mean ``key``; "" if none may."""
    for section in sections:
        if section.key not in KNOWN and get_close_matches(section.key, [key], cutoff=0.8):
            return f"; line {section.line + 1} has {section.key}=, did you mean {key}=?"
    return ""


def count_of(lines: Lines, section: KeywordBlock) -> int:
    """Return the number after the keyword; further words are ignored.

    Raises MeshError if the first word is no whole number, or negative.
    """
    word = (section.value.split() or [b""])[0]
    if not _COUNT.fullmatch(word):
        raise lines.error(
            section.line,
            f"{section.key}= {show(word)} is wrong: a whole number, not negative, is needed",
        )
    return int(word)
