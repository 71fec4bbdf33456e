"""The mesh of info, quality and section: in memory, or with ``--stream`` in its file."""

from __future__ import annotations

import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from slideviz import read
from slideviz.argument_types import record
from slideviz.case.cfg import set_key
from slideviz.case.check import idle_roles
from slideviz.case.lines import entries_of, read_text
from slideviz.case.model import Case
from slideviz.case.motions.motion import named
from slideviz.case.zone_cases import with_marker_names
from slideviz.cli.output_paths import OutputPath, add_case_inputs, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks
from slideviz.errors import CaseError, MeshError, Message, raise_all
from slideviz.mesh.metrics import MetricValues
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.solver.prepare import referenced
from slideviz.solver.steps import Progress
from slideviz.streaming.block_quality import CellCounts, measure_mesh
from slideviz.streaming.source import FileSource, MemorySource, MeshSource, has_cells_of
from slideviz.streaming.stream_input import StreamInput, open_read_only
from slideviz.terms import ROLES, FileFormat, Metric, Role


def read_case(arguments: Namespace) -> Case:
    """Return the case of the arguments, changed by ``--set``, ``--steps`` and ``--zone``."""
    case = changed(Case.read(arguments.case), arguments.set)
    if arguments.step_count is not None:
        case = changed(case, [f"STEPS={arguments.step_count}"], "--steps, which is")
    case = case if arguments.zone is None else case.change(zone=arguments.zone)
    add_case_inputs(arguments, case)
    return case


def read_mesh(case: Case, path: Path) -> tuple[Case, Mesh]:
    """Return the case with the names of the boundaries as its mesh has them, and the mesh.

    The mesh has the reference that the case names.
    """
    mesh = referenced(case, read(path, zone=case.zone, file_format=case.mesh_format))
    return with_marker_names(case, mesh), mesh


def require_mesh_file(arguments: Namespace, case: Case) -> Path:
    """Return the mesh file of a case, or raise CaseError."""
    if case.mesh_file is None:
        raise CaseError(f"{arguments.case}: MESH_FILENAME is missing; it names the mesh to deform")
    return case.mesh_file


def read_inputs(arguments: Namespace, *, is_mesh: bool = False) -> tuple[Case, Mesh]:
    """Return the case and its mesh of a command with ``-o`` (and ``--json``), which can be written.

    ``is_mesh``: whether ``-o`` is a mesh. Errors as `require_output_paths`.
    """
    case = read_case(arguments)
    mesh_file = require_mesh_file(arguments, case)
    require_output_paths(
        arguments,
        OutputPath(arguments.output, "-o", is_mesh=is_mesh),
        OutputPath(getattr(arguments, "json", None), "--json"),
    )
    return read_mesh(case, mesh_file)


def optional_case(arguments: Namespace) -> Case | None:
    """Return the case of the option ``--case``, or None."""
    if arguments.case is None:
        return None
    case = Case.read(arguments.case)
    add_case_inputs(arguments, case)
    return case


def changed(case: Case, texts: Sequence[str], option: str = "--set") -> Case:
    """Return the case with other values of some keys, given as texts KEY=VALUE.

    ``option`` is what messages call the texts. Raises CaseError if texts have another form, there
    is no such key, a value is wrong, or a list of markers takes a marker from the role that it
    needs; with a line for each.
    """
    before = idle_roles(case)
    problems = list[Message]()
    taken: dict[str, tuple[str, Role]] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign:
            rule = f"{option} {text!r} is not of the form KEY=VALUE"
            problems.append(Message(rule))
            continue
        try:
            after = set_key(case, key.strip(), value.strip(), option)
        except CaseError as problem:
            problems += problem.messages
            continue
        for name, role in case.roles.items():
            if after.roles.get(name, role) != role:
                taken[name] = f"{option} {text}", role
        case = after
    raise_all((*problems, *_taken(case, taken)))
    added = [warning for warning in case.warnings if warning not in before]
    return case.change(warnings=(*added, *idle_roles(case)))


def changed_beside(case: Case, texts: Sequence[str]) -> Case:
    """Return the case of a second run of a mesh, which stands beside that of a case.

    Errors as `changed`, or if it is of another mesh.
    """
    other = changed(case, texts, "--beside")
    if (other.mesh_file, other.zone) != (case.mesh_file, case.zone):
        raise CaseError("--beside: two runs side by side must deform the same mesh")
    return other


def with_lines(messages: Iterable[Message], arguments: Namespace) -> tuple[Message, ...]:
    """Return the messages about keys with the case file of the arguments, and the line there."""
    path = getattr(arguments, "case", None)
    if path is None:
        return tuple(messages)
    lines = {entry.key: entry.line for entry in entries_of(read_text(path, "case file")[0])[0]}
    for text in getattr(arguments, "set", ()):
        lines.pop(text.partition("=")[0].strip().upper(), None)

    def placed(message: Message) -> Message:
        files = [place for place in message.place if isinstance(place, Path)]
        if not message.keys or message.line or files not in ([], [path]):
            return message
        line = next((lines[key] for key in message.keys if key in lines), 0)
        return replace(message, place=(*([] if files else [path]), *message.place), line=line)

    return tuple(map(placed, messages))


def _taken(case: Case, taken: Mapping[str, tuple[str, Role]]) -> Iterator[str]:
    """Yield a sentence for each marker that was taken from a role that it needs.

    ``taken`` has, for markers that came into another role, the option that did it and the role
    before.
    """
    periodic = case.markers_with("periodic")
    for name, (option, role) in taken.items():
        if case.roles.get(name) == role:
            continue
        it = f"{option} takes {name} from {ROLES[role].key}"
        if role == "moving" and any(name in named(motion.marker) for motion in case.motions):
            yield f"{it}, but MOTION still moves it; set MOTION, too, or leave {name} out"
        elif role == "moving" and not case.markers_with("moving"):
            yield f"{it}, and no other marker moves; leave {name} out, or set MARKER_MOVING, too"
        elif role == "periodic" and len(periodic) % 2:
            yield f"{it}, which has {', '.join(periodic)} left; markers repeat in pairs: name both"


@record
class OpenMesh:
    """A mesh that a command reads, and the undeformed one if there is a reference."""

    source: MeshSource
    case: Case | None  # with the names of the boundaries as the mesh has them
    reference: Path | None  # the file of the undeformed mesh
    read_base: Callable[[], Mesh | None]
    """Returns the undeformed mesh or, of a mesh in its file, its boundary."""
    stack: ExitStack  # closes files, and removes temporary ones

    def quality(
        self,
        arguments: Namespace,
        counts: CellCounts | None = None,
        metrics: MutableMapping[Metric, MetricValues | None] | None = None,
    ) -> Quality:
        """Return the quality of all cells; ``counts`` and ``metrics`` as for `measure_mesh`."""
        folder = Path(tempfile.gettempdir())
        with progress_of(arguments, "quality") as tick:
            return measure_mesh(
                self.stack,
                folder,
                self.source,
                metric=arguments.metric,
                counts=counts,
                tick=tick,
                metrics=metrics,
            )


@contextmanager
def progress_of(arguments: Namespace, phase: str) -> Iterator[Callable[[float], None]]:
    """Context with a function that shows the progress of a phase, if ``--stream`` is set."""
    with Bar(arguments.stream) as bar:
        yield lambda part: bar.phase(Progress(1, 1, phase, part))


@contextmanager
def open_mesh(arguments: Namespace, case: Case | None = None) -> Iterator[OpenMesh]:
    """Context with the mesh of a command, and the undeformed one.

    That is of ``--reference`` or else of ``--case``, but only where it has the same cells: the case
    may have been given only for its periodic boundaries. Binary copies of texts are in the folder
    for temporary files until the context ends. Raises MeshError if the mesh has a mistake or, with
    ``--stream``, is of no format that can be streamed; or ``--reference`` has other cells.
    """
    folder = Path(tempfile.gettempdir())
    reference = arguments.reference
    with ExitStack() as stack:
        with progress_of(arguments, "read") as tick:

            def open_one(
                path: Path, zone: int | None, kind: FileFormat | None = None
            ) -> Mesh | StreamInput:
                if not arguments.stream:
                    return read(path, zone=zone, file_format=kind)
                return stack.enter_context(open_read_only(path, zone, tick, folder, kind))

            zone = arguments.zone if case is None else arguments.zone or case.zone
            mesh = open_one(arguments.mesh, zone)
            skin = _mesh_of(mesh, tick)
            base = None
            if reference is not None:
                base = open_one(reference, zone)
                mesh = _divided_as(base, mesh)
                if arguments.stream and not _same_cells(mesh, base):
                    raise MeshError(
                        f"{reference} cannot be the reference of {skin.name}: it must have the "
                        "same cells; give the undeformed mesh"
                    )
            elif case is not None and (file := case.reference_file or case.mesh_file):
                kind = case.mesh_format if file == case.mesh_file else None
                base = open_one(file, zone, kind) if file.is_file() else None
                mesh = _divided_as(base, mesh)
                base = base if base is not None and _same_cells(mesh, base) else None
                reference = None if base is None else file
        skin = mesh if isinstance(mesh, Mesh) else skin
        source = _source(stack, mesh, base, skin)
        if case is not None:
            known = len(case.warnings)
            case = with_marker_names(case, skin)
            print_remarks(case.warnings[known:], quiet=False)
        read_base = partial(_mesh_of, base) if base is not None else lambda: None
        yield OpenMesh(source, case, reference, read_base, stack)


def _mesh_of(mesh: Mesh | StreamInput, tick: Callable[[float], object] = lambda _: None) -> Mesh:
    """Return a mesh in memory or, of one in its file, its boundary and the cells at it."""
    return mesh if isinstance(mesh, Mesh) else mesh.skin(tick)


def _divided_as(base: Mesh | StreamInput | None, mesh: Mesh | StreamInput) -> Mesh | StreamInput:
    """Return a mesh in memory with its polyhedra divided as those of ``base``."""
    if isinstance(mesh, Mesh) and isinstance(base, Mesh):
        return mesh.with_parts_of(base)
    return mesh


def _same_cells(mesh: Mesh | StreamInput, base: Mesh | StreamInput) -> bool:
    if isinstance(mesh, Mesh) and isinstance(base, Mesh):
        return base.points.shape == mesh.points.shape and base.cells.same_as(mesh.cells)
    assert not isinstance(mesh, Mesh)
    assert not isinstance(base, Mesh)
    return has_cells_of((mesh.path, mesh.zone), (base.path, base.zone))


def _source(
    stack: ExitStack, mesh: Mesh | StreamInput, base: Mesh | StreamInput | None, skin: Mesh
) -> MeshSource:
    if isinstance(mesh, Mesh):
        assert base is None or isinstance(base, Mesh)
        return MemorySource(mesh, base)
    assert not isinstance(base, Mesh)
    zone = None if base is None else (base.path, base.zone)
    return FileSource.open(stack, (mesh.path, mesh.zone), zone, skin=skin)
