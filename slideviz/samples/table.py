"""The table of the samples: cases of the thesis (chapter 4) at any size, and others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from slideviz.argument_types import frozen, record
from slideviz.case.cfg import case_of_text, write_case
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.errors import CaseError, nearest
from slideviz.formats.files import write
from slideviz.formats.table import ZoneContent, write_content
from slideviz.mesh.model import Mesh
from slideviz.samples.airfoil import airfoil_mesh
from slideviz.samples.impeller import impeller_mesh
from slideviz.samples.passage import passage_mesh
from slideviz.samples.stator import stator
from slideviz.samples.thesis import FILE, Structured, mesh_of, thesis_case, zone_of
from slideviz.samples.turbine_row import extruded_row, row_mesh
from slideviz.samples.wing import wing_mesh
from slideviz.system.atomic import atomic_write, make_folder
from slideviz.terms import FileFormat


@record
class Sample:
    """A mesh and a case that deforms it."""

    name: str  # one of ``SAMPLES``
    mesh: Mesh  # the undeformed mesh
    case: Case  # the case; its files are named as if they were in the current folder
    displacement: Displacements | None = None
    """The content of the case's displacement file; None if it has none."""


Made = tuple[Mesh | Structured, Case, Displacements | None]
SampleMaker = Callable[[str, int, str, bool], Made]


@frozen
class SampleKind:
    """A kind of sample, a row of ``SAMPLES``."""

    about: str  # what it is, in words for users
    counts: str  # what its size counts
    size: int  # the default size
    make: SampleMaker
    """Returns mesh or grid, case and displacement, by name, size and variant, and whether a grid
    is written to its file block by block: it may be larger then."""
    variants: tuple[str, ...] = ("motion",)
    """Names of its motions, the default first. ``file``: by a displacement file; ``motion``: the
    same by MOTION keys; ``translate``: that of thesis Figure 4.4, which moves the block close to
    two sides; ``flat``: that of Figure 4.14, without a component in z; ``layers``: thin cells at
    the wall."""

    def words(self, size: int | None = None) -> str:
        """Return what it is, and a size of it; None: the default size."""
        return f"{self.about}; size: {self.counts} ({size or self.size})"


def _thesis(about: str, variants: tuple[str, ...]) -> SampleKind:
    """Return the row of a case of the thesis."""
    return SampleKind(
        about,
        "cells along a side",
        25,
        lambda name, size, variant, _: thesis_case(name, size, variant),
        variants,
    )


def sample_case(name: str) -> Case:
    """Return the case of a sample whose case is a file beside this module."""
    text = Path(__file__).with_name(f"{name}.cfg").read_text(encoding="utf-8")
    return case_of_text(Path(f"{name}.cfg"), text, Case()).change(source=None)


def _by_file(mesh_of_size: Callable[[int], Mesh]) -> SampleMaker:
    """Return the function that makes a sample of one variant, whose case is a file."""
    return lambda name, size, *_: (mesh_of_size(size), sample_case(name), None)


def _stator(name: str, size: int, _variant: str, streams: bool) -> Made:
    stack, moved = stator(size, streams)
    return stack, sample_case(name), moved


SAMPLES: Mapping[str, SampleKind] = {
    "square": _thesis(
        "2D: turned block in a square, periodic in y (thesis 4.1.1, of 25 or 200)",
        ("file", "motion", "translate"),
    ),
    "polar": _thesis(
        "2D: block in a 30 degree sector, rotationally periodic (thesis 4.1.2)", ("file",)
    ),
    "hexahedron": _thesis(
        "3D: turned block in a cube, periodic in y (thesis 4.2.1)", ("file", "motion", "flat")
    ),
    "cylindrical": _thesis(
        "3D: block in a 30 degree sector, rotationally periodic (thesis 4.2.2)", ("file",)
    ),
    "passage": SampleKind(
        "2D: turbine blade in a periodic passage",
        "cells along the inflow",
        36,
        _by_file(passage_mesh),
    ),
    "airfoil": SampleKind(
        "2D: airfoil turned in a far field of 50 chords",
        "cells around it",
        96,
        lambda name, size, variant, _: (airfoil_mesh(size, variant), sample_case(name), None),
        ("motion", "layers"),
    ),
    "turbine-row": SampleKind(
        "2D: supersonic vane in a cascade, layer and triangles (thesis 4.1.3)",
        "cells, 5000 or 20000",
        20_000,
        _by_file(row_mesh),
    ),
    "turbine-row-3d": SampleKind(
        "3D: the vane from hub to shroud, twisted; hexahedra and prisms",
        "cells, about",
        25_000,
        _by_file(extruded_row),
    ),
    "stator": SampleKind(
        "3D: stator passage, 41 around, hexahedra (thesis 4.2.3)",
        "cells, about",
        240_000,
        _stator,
        ("file",),
    ),
    "impeller": SampleKind(
        "3D: centrifugal compressor passage, 13 around, twisted over its span",
        "cells, about",
        12_000,
        _by_file(impeller_mesh),
    ),
    "wing": SampleKind(
        "3D: swept, tapered wing on a symmetry plane, twisted over its span and bent up",
        "cells, about",
        20_000,
        _by_file(wing_mesh),
    ),
}
"""Every kind of sample, by name."""


def sample(name: str, size: int | None = None, variant: str | None = None) -> Sample:
    """Return a sample case.

    Raises CaseError if there is no such sample or variant, or the size is out of range.
    ``name``: one of ``SAMPLES``.
    ``size``: how many of what ``SAMPLES[name].counts`` says; the usual size when left out.
    ``variant``: one of ``SAMPLES[name].variants``; the first when left out.
    """
    mesh, case, moved = _made(name, size, variant, streams=False)
    assert isinstance(mesh, Mesh)
    return Sample(name, mesh, case, moved)


def _made(
    name: str, size: int | None, variant: str | None, *, streams: bool
) -> tuple[Mesh | ZoneContent, Case, Displacements | None]:
    """Return mesh, case and displacement as `sample`; a grid that ``streams`` as its zone."""
    if name not in SAMPLES:
        hint = nearest(name, SAMPLES)
        raise CaseError(f"no sample {name!r}; the samples are {', '.join(SAMPLES)}{hint}")
    row = SAMPLES[name]
    kind = variant or row.variants[0]
    if kind not in row.variants:
        raise CaseError(f"no variant {kind!r} of {name}; it has {', '.join(row.variants)}")
    size = row.size if size is None else size
    try:
        grid, case, moved = row.make(name, size, kind, streams)
        if isinstance(grid, Mesh):
            return grid, case, moved
        return zone_of(grid) if streams else mesh_of(grid, name), case, moved
    except (MemoryError, OverflowError, ValueError) as problem:
        raise CaseError(
            f"{name}: size {size:,} needs more memory than there is; choose a smaller one (usual: "
            f"{row.size:,})"
        ) from problem


def write_sample(
    name: str,
    folder: str | Path,
    size: int | None = None,
    variant: str | None = None,
    overwrite: bool = False,
    file_format: FileFormat = "su2",
) -> list[Path]:
    """Write ``mesh.su2``, ``displacement.txt`` where there is one, and ``NAME.cfg``; return them.

    As SU2's binary (``mesh.su2b``) a stator and the thesis's cases are written block by block, and
    never as a whole in memory.

    Raises CaseError or MeshError as `sample` does, or if a file exists or cannot be written.
    Parameters are those of ``sample`` and:
    ``folder``: where to; made if there is none.
    ``overwrite``: whether to replace files that exist.
    ``file_format``: the format of the mesh.
    """
    content, case, moved = _made(name, size, variant, streams=file_format == "su2b")
    folder = Path(folder)
    mesh = folder / f"mesh.{file_format}"
    table = folder / FILE
    file = folder / f"{name}.cfg"
    paths = [mesh, *([table] if moved else []), file]
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        raise CaseError(
            f"{there[0]}: exists already; choose another folder, or replace it with --force"
        )
    make_folder(folder)
    if isinstance(content, Mesh):
        write(mesh, content, overwrite)
    else:
        write_content(mesh, [content], mesh if overwrite else None)
    if moved is not None:
        nodes = moved.nodes.tolist()
        vectors = moved.vectors.tolist()
        with atomic_write(table, CaseError, table if overwrite else None) as out:
            for node, vector in zip(nodes, vectors, strict=True):
                out.write(("\t".join([str(node), *map(repr, vector)]) + "\n").encode())
    placed = case.with_paths(folder.joinpath).change(
        mesh_file=mesh,
        mesh_out=folder / f"{name}_deformed.{file_format}",
        source=file if overwrite else None,
    )
    write_case(file, placed)
    return paths
