"""The table of the samples: cases of the thesis (chapter 4) at any size, a passage, an airfoil."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from slideviz.case.cfg import write_case
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.errors import CaseError, nearest
from slideviz.formats.files import write
from slideviz.formats.table import ZoneContent, write_content
from slideviz.mesh.model import Mesh
from slideviz.samples.airfoil import airfoil_case, airfoil_mesh
from slideviz.samples.impeller import impeller_case, impeller_mesh
from slideviz.samples.passage import passage_case, passage_mesh
from slideviz.samples.stator import stator_case, stator_displacement, stator_mesh, stator_zone
from slideviz.samples.thesis import FILE, thesis_case, thesis_zone
from slideviz.samples.turbine_row import extruded_case, extruded_row, row_case, row_mesh
from slideviz.system.atomic import atomic_write, make_folder
from slideviz.terms import FileFormat


@dataclass(frozen=True, eq=False)
class Sample:
    """A mesh and a case that deforms it."""

    name: str  # one of ``SAMPLES``
    mesh: Mesh  # the undeformed mesh
    case: Case  # the case; its files are named as if they were in the current folder
    displacement: Displacements | None = None
    """The content of the case's displacement file; None if it has none."""


@dataclass(frozen=True, eq=False)
class StreamedSample:
    """A `Sample` whose mesh, of any size, is made while it is written, by its ``zone``."""

    zone: ZoneContent
    case: Case
    displacement: Displacements | None = None


@dataclass(frozen=True)
class SampleKind:
    """A kind of sample, a row of ``SAMPLES``."""

    about: str  # what it is, in words for users
    counts: str  # what its size counts
    size: int  # the default size
    make: Callable[[str, int, str], Sample]  # returns the sample of a name, a size and a variant
    variants: tuple[str, ...] = ("motion",)
    """Names of its motions, the default first. ``file``: by a displacement file; ``motion``: the
    same by MOTION keys; ``translate``: that of thesis Figure 4.4, which moves the block close to
    two sides; ``flat``: that of Figure 4.14, without a component in z; ``layers``: thin cells at
    the wall."""
    stream: Callable[[str, int, str], StreamedSample] | None = None
    """Returns the same as a `StreamedSample`; None if that is not possible."""

    def words(self, size: int | None = None) -> str:
        """Return what it is, and a size of it; None: the default size."""
        return f"{self.about}; size: {self.counts} ({size or self.size})"


def _thesis(about: str, variants: tuple[str, ...]) -> SampleKind:
    """Return the row of a case of the thesis."""
    return SampleKind(
        about,
        "cells along a side",
        25,
        lambda name, size, variant: Sample(name, *thesis_case(name, size, variant)),
        variants,
        lambda name, size, variant: StreamedSample(*thesis_zone(name, size, variant)),
    )


def _stator(name: str, size: int, _variant: str) -> Sample:
    mesh = stator_mesh(size)
    nodes = mesh.marker("BLADE").nodes
    moved = stator_displacement(nodes, mesh.points[nodes])
    return Sample(name, mesh, stator_case(), moved)


def _streamed_stator(_name: str, size: int, _variant: str) -> StreamedSample:
    """Return the same as `_stator` with a mesh made while it is written."""
    zone, displacement = stator_zone(size)
    return StreamedSample(zone, stator_case(), displacement)


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
        lambda name, size, _: Sample(name, passage_mesh(size), passage_case()),
    ),
    "airfoil": SampleKind(
        "2D: airfoil turned in a far field of 50 chords",
        "cells around it",
        96,
        lambda name, size, variant: Sample(name, airfoil_mesh(size, variant), airfoil_case()),
        ("motion", "layers"),
    ),
    "turbine-row": SampleKind(
        "2D: supersonic vane in a cascade, layer and triangles (thesis 4.1.3)",
        "cells, 5000 or 20000",
        20_000,
        lambda name, size, _: Sample(name, row_mesh(size), row_case()),
    ),
    "turbine-row-3d": SampleKind(
        "3D: the vane from hub to shroud, twisted; hexahedra and prisms",
        "cells, about",
        25_000,
        lambda name, size, _: Sample(name, extruded_row(size), extruded_case()),
    ),
    "stator": SampleKind(
        "3D: stator passage, 41 around, hexahedra (thesis 4.2.3)",
        "cells, about",
        240_000,
        _stator,
        ("file",),
        _streamed_stator,
    ),
    "impeller": SampleKind(
        "3D: centrifugal compressor passage, 13 around, twisted over its span",
        "cells, about",
        12_000,
        lambda name, size, _: Sample(name, impeller_mesh(size), impeller_case()),
    ),
}
"""Every kind of sample, by name."""


def sample(name: str, size: int | None = None, variant: str | None = None) -> Sample:
    """Return a sample case.

    Raises CaseError if there is no such sample or variant, or the size is out of range.
    ``name``: one of ``SAMPLES``.
    ``size``: cells in each direction; of the passage: cells along its inflow; of the airfoil: cells
    around it; of turbine rows and stator: all cells. The usual size when left out.
    ``variant``: one of ``SAMPLES[name].variants``; the first when left out.
    """
    row, kind = _row(name, variant)
    try:
        return row.make(name, row.size if size is None else size, kind)
    except (MemoryError, OverflowError, ValueError) as problem:
        raise CaseError(
            f"{name}: size {size:,} needs more memory than there is; choose a smaller one (usual: "
            f"{row.size:,})"
        ) from problem


def _row(name: str, variant: str | None) -> tuple[SampleKind, str]:
    """Return the row of a sample, and the variant, by default its first; raise CaseError."""
    if name not in SAMPLES:
        hint = nearest(name, SAMPLES)
        raise CaseError(f"no sample {name!r}; the samples are {', '.join(SAMPLES)}{hint}")
    row = SAMPLES[name]
    kind = variant or row.variants[0]
    if kind not in row.variants:
        raise CaseError(f"no variant {kind!r} of {name}; it has {', '.join(row.variants)}")
    return row, kind


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

    Parameters are those of ``sample`` and:

    Raises CaseError or MeshError as `sample` does, or if a file exists or cannot be written.
    ``folder``: where to; made if there is none.
    ``overwrite``: whether to replace files that exist.
    ``file_format``: the format of the mesh.
    """
    row, kind = _row(name, variant)
    made: Sample | StreamedSample
    if file_format == "su2b" and row.stream is not None:
        made = row.stream(name, row.size if size is None else size, kind)
    else:
        made = sample(name, size, variant)
    folder = Path(folder)
    mesh = folder / f"mesh.{file_format}"
    table = folder / FILE
    case = folder / f"{name}.cfg"
    paths = [mesh, *([table] if made.displacement else []), case]
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        raise CaseError(
            f"{there[0]}: exists already; choose another folder, or replace it with --force"
        )
    make_folder(folder)
    if isinstance(made, StreamedSample):
        write_content(mesh, [made.zone], mesh if overwrite else None)
    else:
        write(mesh, made.mesh, overwrite)
    if made.displacement is not None:
        nodes = made.displacement.nodes.tolist()
        vectors = made.displacement.vectors.tolist()
        with atomic_write(table, CaseError, table if overwrite else None) as file:
            for node, vector in zip(nodes, vectors, strict=True):
                file.write(("\t".join([str(node), *map(repr, vector)]) + "\n").encode())
    placed = _in_folder(made.case, folder, name, file_format)
    write_case(case, placed.change(source=case if overwrite else None))
    return paths


def _in_folder(case: Case, folder: Path, name: str, ending: str) -> Case:
    """Return the case of the sample ``name``, with files in a folder, meshes of ``ending``."""
    mesh = folder / f"mesh.{ending}"
    out = folder / f"{name}_deformed.{ending}"
    return case.with_paths(folder.joinpath).change(mesh_file=mesh, mesh_out=out)
