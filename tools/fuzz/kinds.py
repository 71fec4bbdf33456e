"""The kinds of inputs: files that are right, and the commands that read them."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import slideviz as sv
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.design.su2.gradients import MAGIC, NAME_BYTES
from slideviz.design.sweeps.table import DesignRow
from slideviz.formats.table import FORMATS, format_for
from slideviz.mesh.model import Mesh
from slideviz.sections.model import Section
from slideviz.session import changes, jobs
from slideviz.session.design_table import DesignTable
from slideviz.session.session_file import PICTURE_KEY
from slideviz.session.state import StepFrame
from tests import builders, cgns_files, polymesh_files
from tests.formats.su2_samples import MESSY, SQUARE
from tests.formats.su2_samples import SOLID as SOLID_TEXT
from tests.polymesh_files import Form
from tools.fuzz.damage import NUMBERS, WORDS, Rng, damaged

PLAIN = "plain"
"""The folder of files that lie beside each input."""
MESH, SOLID, CASE, REPEATS = "mesh.su2", "solid.su2", "case.cfg", "repeats.cfg"
"""Files in it."""

ZONES = f"NZONE= 2\nIZONE= 1\n{SQUARE}IZONE= 2\n{SQUARE.replace('lower', 'wall')}FFD_NBOX= 0\n"
BASE = """MESH_FILENAME= mesh.su2
MARKER_MOVING= ( BLOCK )
MARKER_SLIDING= ( x_m, x_p, y_m, y_p )
MOTION= (BLOCK, translate, 0.03, 0.02)
SLIDING_MODE= ps
"""
PERIODIC = """MESH_FILENAME= solid.su2
MARKER_MOVING= ( blade )
MARKER_SLIDING= ( hub, shroud )
MARKER_PERIODIC= ( per1, per2 )
PERIODIC_MODE= moving
SLIDING_MODE= ds
MOTION= (blade, rotate, 1, z, centroid) ; (blade, lean, 0:0, 1:0.01)
SPAN= ( hub, shroud )
RELAX= yes
DATA_REDUCTION= YES
DATA_RED_TOLERANCE= 1e-5
LIMITS= min > 0.1
LAYERS= keep
LAYER_THICKNESS= 0.05
STEPS= 2
"""
CONFIG = """% SU2
SOLVER= EULER
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
MARKER_EULER= ( BLOCK, x_m )
MARKER_SYM= ( y_m, y_p )
MARKER_FAR= ( x_p )
DV_KIND= TRANSLATION, SCALE, ROTATION
DV_MARKER= ( BLOCK )
DV_PARAM= ( 1.0, 0.0, 0.0 ); (1.0); (0.5, 0.5, 0.0, 0.5, 0.5, 1.0)
DV_VALUE= 0.01, 1.02, 2.0
DEFORM_LINEAR_SOLVER_ITER= 100
OBJECTIVE_FUNCTION= DRAG
SOLUTION_ADJ_FILENAME= solution_adj
GRADIENT_METHOD= DISCRETE_ADJOINT
"""
ZEROS = ", 0" * 12
FFD_CONFIG = f"""MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
FFD_DEFINITION= (BOX, .2, .2, 0, .8, .2, 0, .8, .8, 0, .2, .8, 0{ZEROS})
FFD_DEGREE= (2, 2, 0)
FFD_BLENDING= BSPLINE_UNIFORM
FFD_BSPLINE_ORDER= 2, 2, 2
DV_MARKER= ( BLOCK )
DV_KIND= FFD_CONTROL_POINT_2D, FFD_CAMBER_2D
DV_PARAM= ( BOX, 1, 1, 0.0, 1.0 ); ( BOX, 1 )
DV_VALUE= 0.01, 0.01
"""


FOAM = """MESH_FILENAME= case
MARKER_MOVING= ( y_p )
MARKER_SLIDING= ( x_m, x_p )
MOTION= (y_p, translate, 0.02, 0.03, 0.0)
"""
FOAM_ZONES = """MESH_FILENAME= case
MARKER_MOVING= ( 1:y_p, 2:y_p )
MARKER_SLIDING= ( 1:x_m )
MOTION= (1:y_p, translate, 0.02, 0.03, 0.0) ; (2:y_p, translate, 0.0, 0.0, 0.01)
"""


@dataclass(frozen=True)
class Kind:
    """Inputs of one kind. In the words of commands ``@`` is the input."""

    ending: str
    commands: tuple[str, ...]
    make: Callable[[Path], Sequence[bytes]]
    """Returns contents that are right; the folder has the files beside each input."""
    text: bool = True
    draw: Callable[[Rng, Sequence[bytes], bool], bytes] | None = None
    """Returns an input from those of the corpus; `damaged` of one of them by default."""
    share: float = 1.0  # how often it is drawn, relative to others
    folder: str = PLAIN
    """The folder of `write_base` with the files beside the input. Below another one than `PLAIN`
    the input replaces a file: its first line has the name."""

    @property
    def isolated(self) -> bool:
        """Return whether inputs are read in a process of its own."""
        return self.ending not in (".csv", ".foam") and format_for(Path(f"a{self.ending}")).isolated

    def input(self, rng: Rng, corpus: Sequence[bytes]) -> bytes:
        """Return a random input."""
        if self.draw is not None:
            return self.draw(rng, corpus, self.text)
        return damaged(rng, corpus[int(rng.integers(len(corpus)))], corpus, self.text)


def write_base(base: Path) -> None:
    """Write the files that lie beside inputs, into a folder for each `Kind.folder`."""
    for name, (mesh, patches, form) in _foam_cases().items():
        polymesh_files.write_mesh(base / name / "case", mesh, patches, form)
        (base / name / CASE).write_text(FOAM)
    regions = base / "foam regions" / "case" / "constant"
    for name, form in (("air", Form()), ("wall", Form(binary=True))):
        polymesh_files.write_mesh(base / name, builders.grid((2, 2, 2)), None, form)
        regions.mkdir(parents=True, exist_ok=True)
        (base / name / "constant").rename(regions / name)
        (base / name).rmdir()
    head = polymesh_files.HEADER.format(form="ascii", arch="", kind="dictionary", name="regions")
    (regions / "regionProperties").write_text(f"{head}regions ( fluid (air) solid (wall) );\n")
    (base / "foam regions" / CASE).write_text(FOAM_ZONES)
    _write_plain(base / PLAIN)


def _foam_cases() -> dict[str, tuple[Mesh, dict[str, str] | None, Form]]:
    """Return the meshes of OpenFOAM by folder, with the types of their patches, and their forms."""
    solid = builders.grid((2, 2, 2), kind="mixed")
    plane = {"z_m": "empty", "z_p": "empty"}
    return {
        "foam": (solid, None, Form()),
        "foam binary": (solid, {"x_m": "symmetry"}, Form(binary=True)),
        "foam wide": (builders.grid((2, 2, 2)), None, Form(binary=True, label=64, scalar=32)),
        "foam packed": (builders.grid((2, 2, 2)), None, Form(packed=True)),
        "foam plane": (builders.grid((3, 3, 1)), plane, Form()),
    }


def _write_plain(folder: Path) -> None:
    folder.mkdir()
    mesh = builders.square(5, "mixed")
    sv.write(folder / MESH, mesh)
    sv.write(folder / SOLID, builders.passage((3, 4, 4)))
    (folder / CASE).write_text(BASE)
    (folder / REPEATS).write_text(PERIODIC)
    open_sides = PERIODIC.replace("MODE= moving", "MODE= none").replace("MODE= ds", "MODE= none")
    (folder / "open.cfg").write_text(open_sides)
    (folder / "config.cfg").write_text(CONFIG)
    (folder / "designs.csv").write_text("STEPS\n1\n2\n3\n")
    case = Case.read(folder / CASE)
    with closing(
        sv.sweep(case, folder / "designs.csv", workers=1, folder=folder / "swept")
    ) as rows:
        next(rows)
    (folder / "solution_adj_cd.csv").write_bytes(_sensitivities(folder)[0])


def _texts(*texts: str) -> Callable[[Path], Sequence[bytes]]:
    return lambda _folder: [text.encode() for text in texts]


def _meshes(ending: str) -> Callable[[Path], Sequence[bytes]]:
    """Return what makes meshes in a format, of two and of three dimensions."""
    meshes = (
        builders.square(3, "mixed"),
        builders.cube(3, "simplex"),
        builders.grid((2, 2, 2), kind="mixed"),
    )

    def make(folder: Path) -> Sequence[bytes]:
        found = []
        for number, mesh in enumerate(meshes):
            path = folder / f"made{number}{ending}"
            if mesh.dim in FORMATS[ending].dims:
                sv.write(path, mesh)
                found.append(path.read_bytes())
        return found

    return make


def _cgns(folder: Path) -> Sequence[bytes]:
    """Return a CGNS file with two structured zones, and new ones of slideviz."""
    grid = cgns_files.passage_grid((2, 2, 2))
    passage = cgns_files.save_passage(folder / "passage.cgns", grid).read_bytes()
    return [passage, *_meshes(".cgns")(folder)]


def _of_meshio(
    ending: str, forms: Sequence[Mapping[str, object]]
) -> Callable[[Path], Sequence[bytes]]:
    """Return what makes meshes in a format: as slideviz writes it, and in ``forms`` of meshio."""

    def make(folder: Path) -> Sequence[bytes]:
        # Late: only here.
        import meshio

        cube = builders.cube(3, "simplex")
        # It writes elements of one type to Gmsh's newest form.
        mesh = meshio.Mesh(cube.points, [("tetra", cube.cells.by_type[10][1])])
        found = [*_meshes(ending)(folder)]
        path = folder / f"made{ending}"
        for options in forms:
            meshio.write(path, mesh, **options)
            found.append(path.read_bytes())
        return found

    return make


def _files_of(name: str) -> Callable[[Path], Sequence[bytes]]:
    """Return what makes inputs of the files of a folder of OpenFOAM's cases."""

    def make(folder: Path) -> Sequence[bytes]:
        place = folder.parent / name
        files = sorted(path for path in place.rglob("*") if "constant" in path.parts)
        return [
            str(path.relative_to(place)).encode() + b"\n" + path.read_bytes()
            for path in files
            if path.is_file()
        ]

    return make


def damaged_file(rng: Rng, corpus: Sequence[bytes], _text: bool) -> bytes:
    """Return a damaged file of a case; of one that is compressed mostly what is in it."""
    parts = [one.partition(b"\n") for one in corpus]
    name, _, content = parts[int(rng.integers(len(parts)))]
    others = [body for _, _, body in parts]
    packed = name.endswith(b".gz") and rng.random() < 0.8
    if packed:
        unpacker = zlib.decompressobj(wbits=31)
        try:
            content = unpacker.decompress(content, 1 << 20)
        except zlib.error:
            packed = False
    content = damaged(rng, content, others, b" binary;" not in content)
    return name + b"\n" + (gzip.compress(content, mtime=0) if packed else content)


def _surfaces(ending: str) -> Callable[[Path], Sequence[bytes]]:
    def make(folder: Path) -> Sequence[bytes]:
        # Late: only here.
        import meshio

        blade = sv.read(folder / SOLID).marker("blade")
        points = sv.read(folder / SOLID).points[blade.nodes] + np.array([0.005, 0.01, 0.0])
        quads = np.searchsorted(blade.nodes, blade.cells.by_type[9][1])
        cells = [("triangle", np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))]
        path = folder / f"surface{ending}"
        found = []
        for binary in (True, False) if ending == ".stl" else (None,):
            more = {} if binary is None else {"binary": binary}
            meshio.write(path, meshio.Mesh(points, cells), **more)
            found.append(path.read_bytes())
        return found

    return make


def _displacements(folder: Path) -> Sequence[bytes]:
    nodes = sv.read(folder / MESH).marker("BLOCK").nodes
    lines = [f"{node} 0.01 {0.001 * k}" for k, node in enumerate(nodes)]
    return [
        "\n".join(lines).encode(),
        ("% made by hand\n" + "\n".join(lines).replace(" ", ",")).encode(),
    ]


def _sensitivities(folder: Path) -> Sequence[bytes]:
    points = sv.read(folder / MESH).points
    head = '"PointID", "x", "y", "Sensitivity_x", "Sensitivity_y"\n'
    rows = [f"{k}, {x!r}, {y!r}, 0.5, {0.25 * x!r}" for k, (x, y) in enumerate(points.tolist())]
    return [(head + "\n".join(rows)).encode()]


def _sessions(folder: Path) -> Sequence[bytes]:
    """Return sessions with runs, sections and designs."""
    nobody = jobs.Job()
    case = Case.read(folder / CASE)
    session = jobs.open_file(folder / CASE, None, nobody).session
    for steps in (1, 2):
        found: list[object] = []
        jobs.compute(case.change(steps=steps), session.mesh, jobs.Job(found.append))
        frames = [one for one in found if isinstance(one, StepFrame)]
        session = changes.start_run(session, case.change(steps=steps), "")
        session = changes.end_run(changes.add_frames(session, frames), "done")
    session = changes.add_section(session, Section("plane", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)))
    rows = [DesignRow(1, {"STEPS": "2"}, 0.5, 0.75, 1, steps=2), DesignRow(2, problem="too far")]
    table = DesignTable(("STEPS",), (("2",), ("3",))).with_results(rows)
    camera = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5)
    made = []
    for copied in ((), [folder / MESH]):
        path = jobs.save_session(
            folder / "made.slideviz", session, (table, case), camera, copied, nobody
        )
        made.append(path.read_bytes())
    return made


def _pictures(folder: Path) -> Sequence[bytes]:
    """Return pictures with the case that they show."""
    image, info = Image.new("RGB", (4, 3)), PngInfo()
    info.add_text(PICTURE_KEY, f"{BASE}VIEW_SHOW= edges\n", zip=True)
    image.save(folder / "made.png", pnginfo=info)
    return [(folder / "made.png").read_bytes()]


def _restart(folder: Path) -> bytes:
    """Return sensitivities as SU2's binary restart."""
    points = sv.read(folder / MESH).points
    names = ["x", "y", "Sensitivity_x", "Sensitivity_y"]
    head = np.array([MAGIC, len(names), len(points), 0, 0], np.int32).tobytes()
    words = b"".join(name.encode().ljust(NAME_BYTES, b"\0") for name in names)
    return head + words + np.column_stack([points, np.cos(points)]).tobytes()


def _absurd_case(rng: Rng, corpus: Sequence[bytes], _text: bool) -> bytes:
    """Return a case with some keys at extremes."""
    lines = corpus[int(rng.integers(len(corpus)))].decode("utf-8", "replace").splitlines()
    names = list(KEYS)
    for _ in range(int(rng.integers(1, 4))):
        key = KEYS[names[int(rng.integers(len(names)))]]
        lines.append(f"{key.name}= {_absurd_value(rng, key.default, lines)}")
    return "\n".join(lines).encode()


def _absurd_value(rng: Rng, default: str, lines: Sequence[str]) -> str:
    style = rng.random()
    numbers = [*NUMBERS, "0.5", "1e-3", "3", "10", "100"]
    if style < 0.35:
        return numbers[int(rng.integers(len(numbers)))]
    if style < 0.5:
        some = rng.choice(numbers, size=int(rng.integers(1, 5)))
        return "( " + ", ".join(some) + " )"
    if style < 0.65:
        return WORDS[int(rng.integers(len(WORDS)))]
    if style < 0.85:
        # Words of the value, and of values of other keys: names of boundaries, verbs, modes.
        value = lines[int(rng.integers(len(lines)))].partition("=")[2]
        return damaged(rng, value.encode(), [b"yes, no, auto"], True).decode("utf-8", "replace")
    return damaged(rng, default.encode(), [b"1, 2"], True).decode("utf-8", "replace")


_READ = ("read @", "info @", "convert @ out.su2")
_RUN = "run {} -q -o out.su2 --json report.json"
_FOAM = ("read case", "convert case out.su2", "run case.cfg -q -o new --json report.json")
GMSH = (
    {"file_format": "gmsh", "binary": False},
    {"file_format": "gmsh22", "binary": False},
    {"file_format": "gmsh22", "binary": True},
)
NASTRAN = tuple(
    {"file_format": "nastran", "point_format": name} for name in ("fixed-small", "fixed-large")
)
"""Forms of files that slideviz reads and does not write."""
FOAM_FOLDERS = (*_foam_cases(), "foam regions")
KINDS: dict[str, Kind] = {
    "su2": Kind(
        ".su2",
        ("read @", "info @", "quality @ -o out.csv", "convert @ out.su2", "convert @ out.su2b"),
        _texts(SQUARE, SOLID_TEXT, MESSY, ZONES),
        share=3.0,
    ),
    "su2 moved": Kind(
        ".su2",
        (_RUN.format("case.cfg --set MESH_FILENAME=@"),),
        lambda folder: [(folder / MESH).read_bytes()],
        share=2.0,
    ),
    "su2b": Kind(".su2b", _READ, _meshes(".su2b"), text=False, share=2.0),
    "su2b streamed": Kind(
        ".su2b",
        ("run case.cfg -q --set MESH_FILENAME=@ -o out.su2b --stream",),
        lambda folder: [_as_su2b(folder)],
        text=False,
    ),
    "cgns": Kind(".cgns", _READ, _cgns, text=False, share=0.5),
    "vtu": Kind(".vtu", _READ, _meshes(".vtu")),
    "vtk": Kind(".vtk", _READ, _meshes(".vtk"), text=False),
    "xdmf": Kind(".xdmf", _READ, _meshes(".xdmf")),
    "med": Kind(".med", _READ, _meshes(".med"), text=False),
    "msh": Kind(".msh", _READ, _meshes(".msh"), text=False, share=2.0),
    "msh text": Kind(".msh", _READ, _of_meshio(".msh", GMSH)),
    "ugrid": Kind(".b8.ugrid", _READ, _meshes(".b8.ugrid"), text=False),
    "ugrid little": Kind(".lb8.ugrid", _READ, _meshes(".lb8.ugrid"), text=False),
    "inp": Kind(".inp", _READ, _meshes(".inp")),
    "vol": Kind(".vol", _READ, _meshes(".vol")),
    "mesh": Kind(".mesh", _READ, _meshes(".mesh")),
    "bdf": Kind(".bdf", _READ, _of_meshio(".bdf", NASTRAN)),
    "stl": Kind(
        ".stl",
        (_RUN.format("repeats.cfg --set 'MOTION=(blade, onto, @, 0.5)'"), "info @"),
        _surfaces(".stl"),
        text=False,
    ),
    "ply": Kind(
        ".ply",
        (_RUN.format("repeats.cfg --set 'MOTION=(blade, onto, @, 0.5)'"), "info @"),
        _surfaces(".ply"),
    ),
    "case": Kind(".cfg", (_RUN.format("@"),), _texts(BASE, PERIODIC), share=3.0),
    "keys": Kind(".cfg", (_RUN.format("@"),), _texts(BASE, PERIODIC), draw=_absurd_case, share=4.0),
    "gap": Kind(
        ".cfg",
        ("gap @ -q --between hub,shroud --json report.json",),
        _texts(PERIODIC),
        draw=_absurd_case,
        share=0.1,
    ),
    "wheel": Kind(
        ".cfg", ("wheel @ -q -o out.su2",), _texts(PERIODIC), draw=_absurd_case, share=0.2
    ),
    "config": Kind(".cfg", ("def @ -q --json report.json",), _texts(CONFIG, FFD_CONFIG), share=2.0),
    "gradients": Kind(
        ".cfg", ("dot @ -q --json report.json",), _texts(CONFIG, FFD_CONFIG), share=0.5
    ),
    "sensitivities": Kind(
        ".csv", ("dot config.cfg -q --set SOLUTION_ADJ_FILENAME=@",), _sensitivities, share=0.5
    ),
    "displacement": Kind(
        ".txt",
        (_RUN.format("case.cfg --set MOTION= --set DEFORMATION_FILENAME=@"),),
        _displacements,
    ),
    "designs": Kind(
        ".csv",
        ("sweep case.cfg @ -o new -q --workers 1",),
        _texts(
            "BLOCK.translate.x,STEPS\n0.01,1\n0.02,2\n", "# x\nSTEPS;RBF_KERNEL\n1;wendland-c0\n"
        ),
    ),
    "designs in time": Kind(
        ".csv",
        ("sweep case.cfg @ -o new -q --workers 1 --meshes --time-step 0.1",),
        _texts("time,BLOCK.translate.x\n0.1,0.01\n0.2,0.02\n"),
    ),
    "results": Kind(
        ".csv", ("resume @",), lambda folder: [(folder / "swept" / "results.csv").read_bytes()]
    ),
    "restart": Kind(
        ".dat",
        ("dot config.cfg -q --set SOLUTION_ADJ_FILENAME=@",),
        lambda folder: [_restart(folder)],
        text=False,
        share=0.5,
    ),
    "reference": Kind(
        ".su2",
        (_RUN.format("case.cfg --set RELAX=yes --set REFERENCE_FILENAME=@"),),
        lambda folder: [(folder / MESH).read_bytes()],
    ),
    "repair": Kind(
        ".su2",
        ("repair @ -o out.su2 -q --sliding x_m,x_p --json report.json",),
        lambda folder: [(folder / MESH).read_bytes()],
    ),
    "wheel designs": Kind(
        ".csv",
        ("wheel open.cfg -q -o out.su2 --designs @ --steps 1",),
        _texts("blade.rotate.angle_deg\n1\n2\n", "blade.lean.1\n0.01\n0.02\n"),
        share=0.3,
    ),
    "picture": Kind(".png", ("session @",), _pictures, text=False),
    "onto": Kind(
        ".vtu",
        (_RUN.format("repeats.cfg --set 'MOTION=(blade, onto, @, 0.5)' --set LAYERS=no"),),
        _surfaces(".vtu"),
        share=0.5,
    ),
    "session": Kind(".slideviz", ("session @",), _sessions, text=False, share=2.0),
    **{
        name: Kind(".foam", _FOAM, _files_of(name), draw=damaged_file, folder=name)
        for name in FOAM_FOLDERS
    },
}
"""The kinds by name."""


def _as_su2b(folder: Path) -> bytes:
    path = folder / "made.su2b"
    sv.write(path, sv.read(folder / MESH))
    return path.read_bytes()
