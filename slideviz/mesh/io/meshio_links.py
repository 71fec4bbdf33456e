"""Files that name other files: followed into their own folder only, HDF5 not at all.

A mesh that was sent by somebody must not make the program read whatever it names on this disk.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from slideviz.mesh.check import path_error, printable

if TYPE_CHECKING:
    import h5py

_HDF5 = b"\x89HDF\r\n\x1a\n"
_INCLUDE = re.compile(rb"^\*INCLUDE\b[^=\n]*=([^\n]*)", re.IGNORECASE | re.MULTILINE)
_MOST_FILES = 100
"""Files that may be named in a row, each by the one before: they may name each other."""


def require_own(path: Path) -> None:
    """Do nothing for a file that names no other, or only those that lie beside it.

    Raises
    ------
    MeshError
        It names a file in another folder, or has an external link of HDF5.
    OSError
        It cannot be read.
    """
    seen: set[Path] = set()
    waiting = [path]
    while waiting and len(seen) < _MOST_FILES:
        one = waiting.pop()
        seen.add(one)
        for name, found in _named(one):
            if found.parent != Path(os.path.realpath(path.parent)):
                raise path_error(
                    one,
                    f"names a file of another folder, {printable(name)!r}, which is not read; "
                    "put it beside this one, or export the mesh as one file",
                )
            if found.is_file() and found not in seen:
                waiting.append(found)


def _named(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield the names of files that a file has, and where meshio would look for them."""
    with path.open("rb") as file:
        is_hdf5 = file.read(len(_HDF5)) == _HDF5
    if is_hdf5:
        _require_no_links(path)
    elif path.suffix.lower() in (".xdmf", ".xmf"):
        yield from _of_xdmf(path)
    elif path.suffix.lower() == ".inp":
        for match in _INCLUDE.finditer(path.read_bytes()):
            name = match[1].strip().decode("utf-8", "surrogateescape")
            yield name, _place(Path(name) if Path(name).exists() else path.parent / name)


def _of_xdmf(path: Path) -> Iterator[tuple[str, Path]]:
    try:
        items = [item for _, item in ET.iterparse(path) if item.tag == "DataItem"]
    except ET.ParseError:
        return  # meshio says what is wrong with it
    for item in items:
        text, kind = (item.text or "").strip(), item.get("Format")
        if kind == "HDF":
            name = text.rpartition(":")[0]
            yield name, _place(path.parent / name)
        elif kind == "Binary":
            yield text, _place(Path(text))


def _place(path: Path) -> Path:
    """Return a path without ``..`` or links in its folder; the file itself may be a link."""
    return Path(os.path.realpath(path.parent)) / path.name


def _require_no_links(path: Path) -> None:
    """Raise where an HDF5 file takes something from another file."""
    import h5py

    with h5py.File(path, "r") as file:
        seen: set[object] = set()
        groups: list[h5py.Group] = [file]
        while groups:
            group = groups.pop()
            for name in group:
                link = group.get(name, getlink=True)
                other = link.filename if isinstance(link, h5py.ExternalLink) else None
                thing = None if other else group.get(name)
                if isinstance(thing, h5py.Dataset):
                    other = _storage(thing)
                if other is not None:
                    raise path_error(
                        path,
                        f"{printable(f'{group.name}/{name}')!r} is an external link to "
                        f"{printable(other)!r}, which is not read; export the mesh as one file",
                    )
                if isinstance(thing, h5py.Group):
                    key = h5py.h5o.get_info(thing.id).addr
                    if key not in seen:  # a group may hold one that it lies in
                        seen.add(key)
                        groups.append(thing)


def _storage(data: h5py.Dataset) -> str | None:
    """Return the other file that the numbers of a dataset are in, or None."""
    if data.external:
        return str(data.external[0][0])
    if data.is_virtual:
        names = [source.file_name for source in data.virtual_sources()]
        return next((name for name in names if name != "."), None)
    return None
