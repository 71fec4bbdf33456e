"""The tree of nodes of a CGNS file, as the manual "CGNS/HDF5" maps it onto HDF5.

A node is a group with the attributes ``name``, ``label`` (its kind, such as ``Zone_t``) and
``type``; its value is the dataset ``" data"`` in it. Axes are reversed: the first index in the
standard, in Fortran's order, is the last axis of the dataset. A node of type ``LK`` is a link to
another node, which is at ``" link"`` in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError, path_error, printable
from slideviz.mesh.model import IntArray

_ADF = b"ADF Database"  # in the first ``_HEAD_BYTES`` of a CGNS file of the old kind
_HEAD_BYTES = 32
DATA = " data"  # name of the dataset with the value of a node
_LINK = " link"  # name of the HDF5 link in a node that is a link


@contextmanager
def cgns_file(path: Path) -> Iterator[Node]:
    """Context with the root node of a CGNS file; MeshError for any error of h5py in the block."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if _ADF in head:
        raise path_error(
            path,
            "is a CGNS file of the old kind (ADF), but only those based on HDF5 are read; convert "
            "it with the CGNS tools: cgnsconvert -h OLD.cgns NEW.cgns",
        )
    try:
        with h5py.File(path, "r") as tree:
            yield Node(path, tree)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as problem:
        reason = " ".join(str(problem).split())[:160] or type(problem).__name__
        raise path_error(
            path,
            f"cannot be read as CGNS: {reason}; the file is damaged or not a CGNS file: export it "
            "again",
        ) from problem


@record
class Node:
    """A node of the tree: the file, its group in it, and its path, ``/Base/Zone/ZoneBC``.

    The path of a node found by a link is that of the link.
    """

    file: Path
    group: h5py.Group
    path: str = ""

    @property
    def name(self) -> str:
        """Return the last part of its path."""
        return self.path.rpartition("/")[2]

    @property
    def label(self) -> str:
        """Return its kind, e.g. ``Zone_t``; "" if it has none."""
        return _words(self.group.attrs.get("label", b""))

    def fault(self, message: str) -> MeshError:
        """Return the error ``file: node: message``."""
        return path_error(self.file, f"{self.path or '/'}: {message}")

    def children(self, *labels: str) -> list[Node]:
        """Return the children of a kind in ``labels``, in order; MeshError if a link is broken."""
        nodes = []
        for name in self.group:
            thing = self.group.get(name)
            if not isinstance(thing, h5py.Group) or name.startswith(" "):
                continue
            place = f"{self.path}/{printable(name)}"
            if _words(thing.attrs.get("type", b"")) == "LK":
                thing = thing.get(_LINK)
                if not isinstance(thing, h5py.Group):
                    raise path_error(
                        self.file,
                        f"{place}: is a link to a node that is not there; export the mesh as one "
                        "file",
                    )
            node = Node(self.file, thing, place)
            if node.label in labels:
                nodes.append(node)
        return nodes

    def child(self, label: str, *names: str) -> Node | None:
        """Return the first child of a kind, with one of these names if any are given, or None."""
        nodes = self.children(label)
        return next((node for node in nodes if not names or node.name in names), None)

    def needed(self, label: str, *names: str) -> Node:
        """Return the first child of a kind, of one of these names if given; or raise MeshError."""
        node = self.child(label, *names)
        if node is None:
            what = f"{' or '.join(names)} ({label})" if names else label
            raise self.fault(f"has no {what}; export the mesh again, or check it with cgnscheck")
        return node

    def value(self) -> NDArray:
        """Return its value, with the axes as in the dataset; MeshError if it has none."""
        data = self.group.get(DATA)
        if not isinstance(data, h5py.Dataset):
            raise self.fault("has no value; export the mesh again, or check it with cgnscheck")
        return np.asarray(data[()])

    def text(self) -> str:
        """Return its value as text, without the spaces and zero bytes at its end.

        Raises MeshError if the value is not a text, or there is none.
        """
        data = self.value()
        if data.dtype.kind not in "iuS":
            raise self.fault(
                f"has a value of type {data.dtype}; a text is needed (C1): export it again"
            )
        return _words(data.tobytes() if data.dtype.kind == "S" else data.astype("u1").tobytes())

    def integers(self, *shape: int) -> IntArray:
        """Return its value as integers, reshaped to ``shape``; -1 in it is any length.

        Raises MeshError if the value is not of integers, or does not fit the shape.
        """
        data = self.value()
        if data.dtype.kind not in "iu":
            raise self.fault(
                f"has a value of type {data.dtype}; expected I4 or I8: export it again"
            )
        try:
            return data.astype(np.int64).reshape(shape)
        except ValueError:
            wanted = " x ".join("n" if size < 0 else str(size) for size in shape)
            raise self.fault(
                f"has {data.size} numbers of shape {data.shape}; expected {wanted}: export the "
                "mesh again"
            ) from None

    def word(self, label: str, default: str, *names: str) -> str:
        """Return the text of the child that `child` returns, or ``default`` if there is none."""
        node = self.child(label, *names)
        return default if node is None else node.text()


def _words(value: object) -> str:
    """Return the printable part of a text in HDF5, up to its first zero byte, stripped."""
    raw = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogateescape")
    text = raw.partition(b"\0")[0].decode("utf-8", "backslashreplace")
    return "".join(sign for sign in text if sign.isprintable()).strip()
