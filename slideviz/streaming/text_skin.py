"""The skin of an SU2 text mesh, read from an SU2 binary mesh made of it before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from slideviz.errors import MeshError, printable
from slideviz.formats.su2.keyword_blocks import boxes_elsewhere
from slideviz.formats.su2.text import Text, boundaries_elsewhere
from slideviz.mesh.interfaces import find_interfaces
from slideviz.mesh.model import Mesh, Origin
from slideviz.streaming.skin import read_skin
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick


def skin_of_text(text: Text, path: Path, tick: Tick, ranks: SerialPool = SERIAL) -> Mesh:
    """Return the skin of a zone of a text mesh, whose conversion to a binary mesh is at ``path``.

    Names, zone and source are those of the text. Raises MeshError as `read_skin`, naming the text.
    """
    zone = text.zone
    with naming_text(text, path):
        skin = read_skin(path, None, tick, ranks)
    skin = replace(
        skin,
        markers=tuple(
            replace(marker, name=given.name)
            for marker, given in zip(skin.markers, zone.markers, strict=True)
        ),
    )
    others = boundaries_elsewhere(text.lines, text.sections, zone, tick)
    return replace(
        skin,
        name=printable(text.path.name),
        zone=zone.bounds.number,
        zones=zone.bounds.zones,
        source=text.path.resolve(),
        remarks=zone.remarks,
        interfaces=find_interfaces(skin, others),
        origin=Origin(
            ffd=text.boxes(),
            ffd_at=zone.ffd_at,
            ffd_elsewhere=boxes_elsewhere(text.sections, zone.bounds),
        ),
    )


@contextmanager
def naming_text(text: Text, path: Path) -> Iterator[None]:
    """Context in which a `MeshError` on the binary file ``path`` names the text it was made of."""
    try:
        yield
    except MeshError as problem:
        said = str(problem).replace(printable(path), text.lines.name)
        if said == str(problem):
            raise
        raise MeshError(said) from problem
