"""Motions by a list of nodes and their displacements: from a file, or from a program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import frozen, record
from slideviz.case.displacement import (
    Displacements,
    NodesOn,
    PlacedDisplacements,
    read_displacements,
)
from slideviz.case.motions.motion import (
    DesignNumbers,
    Motion,
    MotionStart,
    Target,
    applies_to,
    named,
    nodes_moved,
)
from slideviz.case.values import path_text
from slideviz.case.words import Words
from slideviz.errors import CaseError, Message
from slideviz.mesh.model import FloatArray, IntArray, Mesh, ZonePart, frozen_array
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import Term, Texts

if TYPE_CHECKING:
    from slideviz.case.model import Case

_READ = WeakCache()


@frozen
class FromFile(Motion):
    """Displace nodes as a file lists: node index, then the Cartesian displacement.

    ``marker`` empty: the file serves all moving markers (RBF-SliDe's DEFORMATION_FILENAME).
    """

    path: Path
    marker: Target = ""

    kind_term = Term("displacement file", "A line for each node: its number and its displacement.")
    verbs = ("file",)
    grammar: ClassVar[Texts] = (
        "(BLADE, file, path)                           node, dx, dy[, dz] in each line",
    )
    rows: ClassVar[Texts] = ("path",)
    file_words = "displacement file"
    has_table = True
    lists_nodes = True
    checked_as_text = False
    in_zones = False

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "path", Path(self.path))

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        if len(words) != 1:
            words = []
        return cls(read_path(words), marker)

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(Path(), marker)

    def arguments(self) -> list[str]:
        path = path_text(self.path)
        # Commas and spaces separate here, unlike in a value that is a path only.
        quoted = any(sign in path for sign in " ,") and path[0] != '"'
        return [f'"{path}"' if quoted else path]

    def described(self, dim: int, extent: float) -> str:
        return f"displace as in {self.path.name or '(no file yet)'}"

    def label(self, form: str, *, exact: bool) -> str:
        return str(self.path) if exact else self.path.name or "(no file yet)"

    @classmethod
    def placed(
        cls, case: Case, mesh: Mesh, on: NodesOn, problems: list[Message]
    ) -> PlacedDisplacements:
        found: PlacedDisplacements = {}
        for place, motion in enumerate(case.motions):
            if not isinstance(motion, FromFile) or type(motion) is not cls:
                continue
            moved = {name: nodes for name, nodes in on.items() if applies_to(motion, name)}
            if not moved and motion.marker:
                continue
            try:
                found[place] = motion.listed(case, mesh, moved)
            except CaseError as problem:
                problems += problem.messages
        return found

    def listed(self, case: Case, mesh: Mesh, moved: NodesOn) -> Displacements:
        """Return what the file lists for markers and their nodes; read again if it has changed."""
        nodes = nodes_moved(self, moved)
        names = " or ".join(repr(name) for name in named(self.marker))
        of = f"marker {names}" if names else "a moving marker"
        read = partial(read_displacements, self.path, mesh, nodes, of)
        try:
            state = self.path.stat()
        except OSError:
            return read()
        key = self.path, tuple(moved), state.st_mtime_ns, state.st_size
        return _READ.of(mesh, key, read)

    @property
    def is_case_file(self) -> bool:
        return not self.marker

    @property
    def joins_zones(self) -> bool:
        return True

    @property
    def files(self) -> tuple[Path, ...]:
        return (self.path,)

    def with_files(self, change: Callable[[Path], Path]) -> Motion:
        return replace(self, path=change(self.path))

    def design_numbers(self) -> DesignNumbers:
        yield from ()


def read_path(words: Words) -> Path:
    """Return the path that begins some words; raise CaseError if there is none."""
    if not words or not words[0].text:
        raise CaseError(
            "expected (MARKER, file, path); a path with spaces, commas or brackets needs quotes"
        )
    return Path(words[0].text.replace("\\", "/"))


@record
class Prescribed(Motion):
    """Displace nodes (k,) by vectors (k, d), given by a program; it cannot be in a case file.

    Nodes are ascending, each once. Nodes of the markers that are not among them stay in place.
    """

    nodes: NDArray[np.int64]
    vectors: NDArray[np.float64]
    marker: Target = ""

    lists_nodes = True
    checked_as_text = False

    def __post_init__(self) -> None:
        super().__post_init__()
        nodes = frozen_array(self.nodes, np.int64)
        vectors = frozen_array(self.vectors, np.float64)
        if nodes.ndim != 1 or vectors.ndim != 2 or len(nodes) != len(vectors):
            raise CaseError(
                f"nodes and vectors have the shapes {nodes.shape} and {vectors.shape}; expected "
                "(k,) and (k, d)"
            )
        if (np.diff(nodes) <= 0).any() or not np.isfinite(vectors).all():
            raise CaseError("nodes must be ascending, each once, and their vectors finite")
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "vectors", vectors)

    def arguments(self) -> list[str]:
        raise CaseError(
            "displacements that a program gave cannot be written to a case file; write them to a "
            "displacement file"
        )

    def described(self, dim: int, extent: float) -> str:
        return f"displace {len(self.nodes):,} nodes as given"

    def label(self, form: str, *, exact: bool) -> str:
        return f"{len(self.nodes):,} nodes as given"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        components = self.vectors.shape[1]
        if components != mesh.dim:
            yield (f"its vectors have {components} components, and the mesh {mesh.dim} dimensions")
        moving = set(case.markers_with("moving")).intersection(mesh.marker_names)
        on = mesh.nodes_of(name for name in moving if applies_to(self, name))
        stray = np.setdiff1d(self.nodes, on)
        if len(stray):
            more = f" (and {len(stray) - 1} more)" if len(stray) > 1 else ""
            yield f"node {stray[0]}{more} is on none of the markers that it moves; remove it"

    def change(
        self, points: FloatArray, nodes: IntArray, placed: Displacements | None
    ) -> FloatArray:
        out = np.zeros_like(points)
        _, here, listed = np.intersect1d(nodes, self.nodes, return_indices=True)
        out[here] = self.vectors[listed]
        return out

    @property
    def content(self) -> tuple[FloatArray | IntArray, ...]:
        return self.nodes, self.vectors

    def of_zone(self, part: ZonePart, zone: Case) -> Motion | None:
        nodes = self.nodes - part.points.start
        here = (nodes >= 0) & (nodes < len(part.mesh.points))
        return replace(self, nodes=nodes[here], vectors=self.vectors[here])

    def design_numbers(self) -> DesignNumbers:
        yield from ()
