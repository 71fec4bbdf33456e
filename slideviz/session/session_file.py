"""Session files (``.slideviz``): cases, runs and designs in a zip, of which nothing is executed.

``case.cfg`` has the case with its view, ``session.json`` the rest, with names of other members: the
points of each step and other arrays are files of NumPy (``.npy``), the cases of runs are ``.cfg``
files. ``files/`` has copies of the mesh and of other files of the case, if there are any. Nothing
is compressed, so that a file cannot grow when it is read. HDF5 is not used: its library can crash
on a damaged file.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import field, is_dataclass, replace
from hashlib import blake2b
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import annotations_of, frozen, origin_of
from slideviz.case.cfg import case_of_text, case_text
from slideviz.case.model import Case
from slideviz.errors import CaseError, SlidevizError, printable
from slideviz.formats.openfoam_paths import ENDING as FOAM
from slideviz.formats.openfoam_paths import ending_of
from slideviz.mesh.model import Mesh
from slideviz.session.changes import show_frame
from slideviz.session.design_table import DesignTable
from slideviz.session.saving import Camera, files_of, view_to_case
from slideviz.session.state import Guess, Run, Session, StepFrame, ViewState
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import require_regular_file

ENDING = ".slideviz"
PICTURE_KEY = "slideviz"  # of the text in a PNG file that is its case
VERSION = 1  # of the form of the file
_LARGEST_TEXT = 100_000_000  # most bytes of a text in it
_CASE = "case.cfg"
_HEAD = "session.json"
_OF_FRAMES = ("step", "label")  # fields of frames; others are computed again from their points
_OF_POINTS = ("control", "nodes")  # fields that are numbers of points; others are of cells
_VIEW = (
    "drawn", "selected", "frame", "marked_cell", "marked_in", "beside", "swapped", "ranges",
    "section_index", "handle", "motion_index",
)  # fmt: skip
"""The fields of a view that a case file lacks, or has only where they differ from a default."""


@frozen
class StoredSession:
    """What a session file has besides the case with its view."""

    mesh: str = ""  # `digest` of the undeformed mesh
    mesh_file: Path = Path()
    source: Path | None = None  # the file that the case was saved to
    guesses: Mapping[str, Guess] = field(default_factory=dict)
    runs: tuple[Run, ...] = ()  # of frames only steps and labels
    shown: int | None = None
    newest: int = 0
    view: ViewState = field(default_factory=ViewState)  # only `_VIEW`
    section_names: tuple[str, ...] = ()
    designs: DesignTable = field(default_factory=DesignTable)
    designs_case: Case | None = None  # of the results of the designs
    version: int = VERSION

    def put_into(self, session: Session, runs: Sequence[Run]) -> Session:
        """Return a session just opened with guesses, view and ``runs`` of this one."""
        named = zip(session.view.sections, self.section_names, strict=False)
        sections = tuple(replace(section, name=name) for section, name in named)
        view = {name: getattr(self.view, name) for name in _VIEW}
        if len(sections) == len(session.view.sections):
            view["sections"] = sections
        session = replace(
            session,
            guesses=dict(self.guesses),
            runs=tuple(runs),
            shown=self.shown if self.shown in [run.number for run in runs] else None,
            newest=self.newest,
            view=replace(session.view, **view),
        )
        return show_frame(session, session.view.frame)


def stored_session(
    session: Session, designs: DesignTable, designs_case: Case | None, runs: Sequence[Run] = ()
) -> StoredSession:
    """Return what a session file is to have, with some of the session's runs."""
    return StoredSession(
        mesh=digest(session.opened_mesh),
        mesh_file=session.case.mesh_file or Path(),
        source=session.case.source,
        guesses=session.guesses,
        runs=tuple(replace(run, saved=True) for run in runs if run.end),
        shown=session.shown,
        newest=session.last_number,
        view=session.view,
        section_names=tuple(section.name for section in session.view.sections),
        designs=designs,
        designs_case=designs_case,
    )


def digest(mesh: Mesh) -> str:
    """Return a text that differs for meshes with other points, cells or names of boundaries."""
    content = blake2b(repr(mesh.marker_names).encode(), digest_size=16)
    for values in (mesh.points, mesh.cells.connectivity):
        content.update(np.ascontiguousarray(values).data)
    return content.hexdigest()


# Writing ---------------------------------------------------------------------------------
def write_session(
    path: Path,
    session: Session,
    content: StoredSession,
    camera: Camera | None,
    copied: Sequence[Path] = (),
    going_on: Callable[[], object] = lambda: None,
) -> None:
    """Write a session file, whole or not at all.

    ``copied`` are the files of the case that it is to contain. ``going_on`` is called before each
    array; what it raises ends the writing. Raises CaseError if the file cannot be written, and for
    a copy of a mesh that is several files.
    """
    for file in copied:
        if ending_of(file) == FOAM:
            raise CaseError(
                f"{file}: a mesh of OpenFOAM is several files; save the session without its mesh"
            )
    copies = {file: f"files/{k}/{file.name}" for k, file in enumerate(copied)}
    source = session.case.source
    with atomic_write(path, CaseError, source) as out, ZipFile(out, "w", ZIP_STORED) as archive:
        writer = _Writer(archive, path, copies, going_on)
        writer.encoded(view_to_case(session, camera), Path(_CASE).stem)
        head = json.dumps(writer.encoded(content, ""), default=lambda value: value.item())
        archive.writestr(_HEAD, head)
        for file, name in copies.items():
            going_on()
            archive.write(file, name)


@frozen
class _Writer:
    archive: ZipFile
    path: Path  # of the session file
    copies: Mapping[Path, str]  # members, by the files that they are copies of
    going_on: Callable[[], object]
    known: dict[int, str] = field(default_factory=dict)  # members of arrays, by their identity

    def encoded(self, value: Any, place: str) -> Any:
        """Return a value as values of JSON; arrays and cases become members named by ``place``."""
        if isinstance(value, Mesh):
            value = value.points
        if isinstance(value, np.ndarray):
            return self.known.get(id(value)) or self._array(value, f"{place.strip('/')}.npy")
        if isinstance(value, Case):
            name = f"{place.strip('/')}.cfg"
            folder = self.path.parent
            copies = {file: folder / copy for file, copy in self.copies.items()}
            case = value.with_paths(lambda file: copies.get(file, file))
            self.archive.writestr(name, case_text(self.path, case))
            return name
        if is_dataclass(value):
            # Not those whose types only mypy knows: sections, and functions.
            made: Any = type(value)
            names = _OF_FRAMES if made is StepFrame else annotations_of(made)
            fields = {name: self.encoded(getattr(value, name), f"{place}/{name}") for name in names}
            return {"class": made.__name__, **fields}
        if isinstance(value, Mapping):
            return {key: self.encoded(each, f"{place}/{key}") for key, each in value.items()}
        if isinstance(value, Set):
            value = tuple(sorted(value))  # the same session makes the same file
        if isinstance(value, tuple):
            return [self.encoded(each, f"{place}/{k}") for k, each in enumerate(value)]
        return {"path": str(value)} if isinstance(value, Path) else value

    def _array(self, values: NDArray, name: str) -> str:
        self.going_on()
        with self.archive.open(name, "w", force_zip64=True) as member:
            np.lib.format.write_array(member, np.ascontiguousarray(values), (1, 0), False)
        self.known[id(values)] = name
        return name


# Reading ---------------------------------------------------------------------------------
class MissingMeshError(CaseError):
    """The mesh of a session file or a picture is not there."""


def read_case_of(
    path: Path, unpacked: Path, mesh: Path | None = None
) -> tuple[Case, dict[Path, Path]]:
    """Return the case in a session file, and where its files are now, by where they were.

    Copies of files that the session has are written to the folder ``unpacked``. ``mesh``: as of
    `placed`. Raises CaseError if the file is damaged.
    """
    with _archive(path) as archive:
        reader = _Reader(archive, path)
        copies = [name for name in archive.namelist() if name.startswith("files/")]
        moved = {path.parent / name: reader.unpack(name, unpacked) for name in copies}
        return placed(reader.decoded(_CASE, Case), path, moved, mesh)


def read_picture(path: Path, mesh: Path | None = None) -> Case:
    """Return the case that a picture of the window has as text, with the view of the picture.

    ``mesh``: as of `placed`. Raises CaseError if it has none.
    """
    # Late: Pillow comes with what draws; computing does without it.
    from PIL import Image

    try:
        with Image.open(path, formats=["PNG"]) as image:
            text = str(image.info[PICTURE_KEY])
    except (OSError, ValueError, SyntaxError, KeyError) as problem:
        raise CaseError(
            f"{printable(path)}: has no case in it; open a picture that the window has exported"
        ) from problem
    return placed(case_of_text(path, text, Case()), path, {}, mesh)[0].change(source=None)


def placed(
    case: Case, path: Path, moved: Mapping[Path, Path], mesh: Path | None = None
) -> tuple[Case, dict[Path, Path]]:
    """Return a case with its files where they are now, and these by where they were.

    That is as ``moved`` has them, or beside the file ``path``, or else as before. ``mesh``: the
    mesh file, where the user has chosen it. Raises MissingMeshError if there is none.
    """
    there = dict(moved)
    for file in files_of(case):
        beside = path.with_name(file.name)
        there.setdefault(file, beside if beside.is_file() else file)
    was = case.mesh_file
    if was is None:
        raise CaseError(f"{printable(path)}: the case in it names no mesh; open the mesh itself")
    there[was] = mesh or there[was]
    if not there[was].is_file():
        raise MissingMeshError(
            f"{printable(path)}: its mesh {printable(was.name)} is neither beside it nor in "
            f"{printable(was.parent)}; put it there, or choose the file"
        )
    return case.with_paths(lambda file: there.get(file, file)), there


def read_session(
    path: Path, first: StepFrame | None = None, moved: Mapping[Path, Path] | None = None
) -> StoredSession:
    """Return what a session file has besides its case.

    ``first`` is its undeformed mesh; without runs if that is another one now, or not known. Their
    frames have its quality, until theirs is computed. ``moved``: as of `read_case_of`. Raises
    CaseError if the file is damaged.
    """
    with _archive(path) as archive:
        reader = _Reader(archive, path, first, moved or {})
        head = json.loads(reader.text(_HEAD))
        if head["version"] > VERSION:
            raise CaseError(f"{path}: was saved by a newer slideviz; update slideviz to open it")
        if first is None or head["mesh"] != digest(first.mesh):
            head["runs"] = []
        content: StoredSession = reader.decoded(head, StoredSession)
        return content


@contextmanager
def _archive(path: Path) -> Iterator[ZipFile]:
    """Context with a session file to read; CaseError in one sentence where it is damaged."""
    try:
        size = require_regular_file(path, CaseError)
        with ZipFile(path) as archive:
            members = archive.infolist()
            total = sum(each.file_size for each in members)
            if total > size or any(each.compress_type for each in members):
                raise ValueError("its members are compressed, or larger than the file")
            yield archive
    except SlidevizError:
        raise
    except Exception as problem:  # what a damaged file raises depends on where it is damaged
        reason = (str(problem).splitlines() or [type(problem).__name__])[0][:200]
        raise CaseError(
            f"{printable(path)}: is damaged, or not a session file ({reason}); open another copy "
            "of it"
        ) from problem


@frozen
class _Reader:
    archive: ZipFile
    path: Path
    first: StepFrame | None = None
    moved: Mapping[Path, Path] = field(default_factory=dict)  # where files of cases are now
    known: dict[str, NDArray] = field(default_factory=dict)  # arrays, by their members

    def text(self, name: str) -> str:
        if self.archive.getinfo(name).file_size > _LARGEST_TEXT:
            raise ValueError(f"{name} is too large")
        return self.archive.read(name).decode()

    def unpack(self, name: str, folder: Path) -> Path:
        """Write a copy of a file that the session has into a folder of its own, and return it.

        Only the last part of its name counts, so that it cannot be elsewhere.
        """
        if Path(name).name == "..":
            raise ValueError(f"{name!r} is not the name of a file")
        info = self.archive.getinfo(name)
        target = folder / f"{info.CRC:08x}-{info.file_size}" / Path(name).name
        target.parent.mkdir(parents=True, exist_ok=True)
        with self.archive.open(name) as member, atomic_write(target) as out:
            shutil.copyfileobj(member, out)
        return target

    def decoded(self, value: Any, kind: Any, name: str = "") -> Any:
        """Return a value of JSON as a value of a type; raise ValueError if it is not one.

        ``name``: the field that it is the value of.
        """
        inner = get_args(kind)
        kind = origin_of(kind) or kind
        if kind in (Union, UnionType):
            return self._first(value, inner, name)
        if kind is Literal and value in inner:
            return value
        if kind is Case and isinstance(value, str):
            return self._case(self.text(value))
        if kind is Mesh and self.first is not None:
            points = self._array(value, np.float64)
            mesh = self.first.mesh
            if points.shape == mesh.points.shape and np.isfinite(points).all():
                return mesh.with_points(points)
        if kind is np.ndarray:
            (number,) = get_args(inner[-1]) or inner  # of a dtype, or of an alias
            return self._numbers(value, number, name)
        if is_dataclass(kind) and isinstance(value, dict):
            return self._dataclass(dict(value), kind)
        if kind in (tuple, frozenset) and isinstance(value, list):
            kinds = [inner[0]] * len(value) if kind is frozenset or ... in inner else inner
            each = (self.decoded(*pair, name) for pair in zip(value, kinds, strict=True))
            return kind(each)
        if kind is Mapping and isinstance(value, dict):
            return {inner[0](key): self.decoded(one, inner[1]) for key, one in value.items()}
        if kind is Path and isinstance(value, dict):
            return Path(value["path"])
        if kind is float and type(value) is int:
            return float(value)
        if type(value) is not kind:
            raise ValueError(f"{name or 'a value'} has a wrong type")
        if kind is int and name in _VIEW and value < 0:
            raise ValueError(f"{name} is negative")
        return value

    def _case(self, text: str) -> Case:
        try:
            case = case_of_text(self.path, text, Case())
        except CaseError as problem:
            raise ValueError(problem.messages[0].text) from problem
        return case.with_paths(lambda file: self.moved.get(file, file))

    def _first(self, value: Any, kinds: Sequence[Any], name: str) -> Any:
        """Return a value as one of the first of some types that it fits."""
        if value is None and NoneType in kinds:
            return None
        some = [kind for kind in kinds if kind is not NoneType]
        for kind in some[:-1]:
            with suppress(ValueError):
                return self.decoded(value, kind, name)
        return self.decoded(value, some[-1], name)

    def _dataclass(self, fields: dict[str, Any], kind: Any) -> Any:
        known = {each.__name__: each for each in (kind, *kind.__subclasses__())}
        made = known[fields.pop("class")]
        hints = annotations_of(made)
        some = ((name, each) for name, each in fields.items() if name in hints)
        values = {name: self.decoded(each, hints[name], name) for name, each in some}
        if made is StepFrame and self.first is not None:
            values |= {"mesh": values["step"].mesh, "quality": self.first.quality}
        return made(**values)

    def _array(self, name: str, kind: Any) -> NDArray:
        """Return a read-only array of a member; ValueError if it is not of that type and size."""
        if name not in self.known:
            with self.archive.open(name) as member:
                np.lib.format.read_magic(member)
                shape, by_columns, dtype = np.lib.format.read_array_header_1_0(member)
                if by_columns:
                    raise ValueError(f"{name} is in another order")
                self.known[name] = np.frombuffer(member.read(), dtype).reshape(shape)
        if self.known[name].dtype != np.dtype(kind):
            raise ValueError(f"{name} has a wrong type")
        return self.known[name]

    def _numbers(self, name: str, kind: Any, of: str) -> NDArray:
        """Return an array; numbers of points or cells must be of the mesh."""
        values = self._array(name, kind)
        if values.dtype == np.int64 and self.first is not None and values.size:
            mesh = self.first.mesh
            most = len(mesh.points if of in _OF_POINTS else mesh.cells)
            if values.ndim != 1 or values.min() < 0 or values.max() >= most:
                raise ValueError(f"{name} has numbers beyond the mesh")
        return values
