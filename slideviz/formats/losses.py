"""What files lack of the meshes that are written to them, in words.

The table of formats says which parts of a mesh a format keeps.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from slideviz.formats.su2.lines import is_ffd
from slideviz.formats.su2.read import Document
from slideviz.formats.su2.text import SEND_RECEIVE, Text
from slideviz.formats.table import FORMATS, MeshFormat, format_for, usual_ending
from slideviz.mesh.model import Assembly, Mesh
from slideviz.mesh.zones import zones_of
from slideviz.terms import FileFormat, Texts

OTHER_ZONES = "the other zones"  # what a file of one zone loses
DIVISION = "the division into zones"  # what a file without zones loses of a mesh of all


def left_out(path: Path, mesh: Mesh) -> str:
    """Return a sentence on the parts of a mesh that the format of a file cannot hold, or ""."""
    row = format_for(path)
    has_quality = row.solver or row.quality
    lost = [*([] if has_quality else ["the quality of the cells"]), *lost_in(row, mesh)]
    return f"{path.name} does not hold {join_words(lost)}." if lost else ""


def lost_in(row: MeshFormat, mesh: Mesh) -> list[str]:
    """Return words for the parts of a mesh and its file that a file of a format lacks."""
    lost: list[str] = []
    same = mesh.origin.ending == row.ending != ""
    if same and row.copies:
        return lost
    if same or (isinstance(mesh, Assembly) and row.zones):  # the other zones are kept
        mesh = replace(mesh, zones=1)
    if mesh.markers and row.boundaries == "numbers":
        lost.append("the names of the boundaries (they are numbers now)")
    if not row.sections:
        lost += lost_of_mesh(mesh)
    elif mesh.zones > 1:
        lost.append(OTHER_ZONES)
    if mesh.origin.extras and not same:
        lost.append(mesh.origin.extras)
    return lost


def lost_of_mesh(mesh: Mesh) -> Texts:
    """Return what the file of a mesh has besides points, cells and boundaries, in words."""
    keys = []
    has_halo = mesh.halo is not None
    for document in (zone.origin for zone in zones_of(mesh)):
        keys += ["FFD_NBOX"] if document.ffd else []
        if isinstance(document, Document):
            texts = (document.raw[a:b] for a, b in document.unknown)
            keys += [text.partition(b"=")[0].strip().decode() for text in texts]
            has_halo = has_halo or bool(document.sends)
    halo = (f"the halo ({SEND_RECEIVE}; its cells are ordinary cells now)",) if has_halo else ()
    lost = lost_of_text(keys, mesh.zones)
    return *halo, *(
        DIVISION if isinstance(mesh, Assembly) and one == OTHER_ZONES else one for one in lost
    )


def lost_of_text(keys: Iterable[str], zones: int) -> Texts:
    """Describe which parts of an SU2 text a binary file cannot hold; empty if none.

    ``keys`` are those of sections that slideviz does not know, ``zones`` the number of zones.
    """
    unique = dict.fromkeys(key.upper() for key in keys)
    others = ", ".join(key for key in unique if not is_ffd(key.encode()))
    lost = {
        "the FFD boxes": any(is_ffd(key.encode()) for key in unique),
        f"the other sections ({others})": bool(others),
        OTHER_ZONES: zones > 1,
    }
    return tuple(words for words, is_lost in lost.items() if is_lost)


def lost_of_texts(texts: Sequence[Text]) -> Texts:
    """Describe which parts of zones of an SU2 text a binary file of these cannot hold."""
    keys = (part.key for text in texts for part in text.zone.unknown)
    return lost_of_text(keys, texts[0].zone.bounds.zones if len(texts) == 1 else 1)


def join_words(lost: Sequence[str]) -> str:
    """Join words (at least one) for a sentence: ``a, b and c``."""
    *first, last = lost
    return f"{', '.join(first)} and {last}" if first else last


def sentence_of_lost(
    output: Path, name: str, lost: Sequence[str], ending: str = ".su2", *, alone: bool = False
) -> str:
    """Return in words what a file will not have of a mesh; nothing where it has all.

    ``ending``: of a file that would have it. ``alone``: whether one of several zones is converted,
    as ``--zone`` asks for.
    """
    if not lost:
        return ""
    remedy = f"write a {ending} file"
    if alone:
        is_enough = format_for(output).zones and list(lost) == [OTHER_ZONES]
        remedy = "leave out --zone" if is_enough else f"leave out --zone and {remedy}"
    return f"{output} lacks {join_words(lost)} of {name}; {remedy} to keep them"


def warning_of_losses(
    output: Path, mesh: Mesh, file_format: FileFormat | None = None, *, alone: bool = False
) -> str:
    """Return a warning on what a file will lack of a mesh; "" if nothing.

    ``alone`` is whether one of several zones is converted. Raises MeshError if the format cannot
    hold the mesh.
    """
    row = format_for(output, file_format)
    if row.require:
        row.function("require")(mesh, output)
    lost = lost_in(row, mesh)
    ending = usual_ending(mesh)
    if lost != [OTHER_ZONES] and not FORMATS[ending].sections and not FORMATS[ending].copies:
        ending = ".su2"
    return sentence_of_lost(output, mesh.name, lost, ending, alone=alone)
