"""What is kept: commands by parts, each of which can be recorded and compared for itself."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path
from unittest.mock import patch

from PIL import Image

from slideviz.terms import PERIODIC_MODES, SLIDING
from tests.golden.desk import Desk, keep_picture

SIZES = {
    "square": 8,
    "polar": 8,
    "hexahedron": 6,
    "cylindrical": 6,
    "passage": 12,
    "turbine-row": 5000,
    "stator": 5000,
}
"""Cells of the samples, as small as they are offered."""

VARIANTS = {"square": ("file", "motion", "translate"), "hexahedron": ("file", "motion", "flat")}
COMMANDS = (
    "run",
    "info",
    "quality",
    "section",
    "film",
    "compare",
    "convert",
    "sample",
    "keys",
)

PERIODIC = tuple(PERIODIC_MODES)
REDUCED = ("DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=1e-3")
METHODS: tuple[tuple[str, ...], ...] = (
    *((f"SLIDING_MODE={way}", f"PERIODIC_MODE={mode}") for way in SLIDING for mode in PERIODIC),
    ("METHOD=idw", "SLIDING_MODE=none", "PERIODIC_MODE=fixed"),
    ("METHOD=elastic", "SLIDING_MODE=none", "PERIODIC_MODE=periodic"),
    REDUCED,
)
MORE_METHODS: tuple[tuple[str, ...], ...] = (
    ("METHOD=idw", "SLIDING_MODE=none", "PERIODIC_MODE=none", "IDW_POWER=3"),
    ("METHOD=idw", "SLIDING_MODE=none", "PERIODIC_MODE=fixed", "IDW_FIXED_WEIGHT=4"),
    ("METHOD=elastic", "SLIDING_MODE=none", "PERIODIC_MODE=fixed"),
    (*REDUCED, "MULTILEVEL=YES"),
    (*REDUCED, "MULTILEVEL=YES", "MULTI_CRIT=tol"),
    (*REDUCED, "SELECTION=double"),
    (*REDUCED, "SELECTION=one"),
    (*REDUCED, "MAX_CONTROL_NODES=12"),
    ("DATA_REDUCTION=YES", "DATA_RED_RELATIVE=0.05"),
    ("CURVED=YES",),
    ("FEATURE_ANGLE=5",),
    ("INFLUENCE_FACTOR=1",),
    ("GENERATE_QUALITY=NO",),
    ("QUALITY_METRIC=rbf-slide",),
    ("STEPS=auto",),
    *((f"RBF_KERNEL={name}",) for name in ("wendland-c0", "wendland-c4", "wendland-c6")),
    *((f"RBF_KERNEL={name}",) for name in ("ctps-c0", "ctps-c1", "ctps-c2a", "ctps-c2b")),
    ("RBF_KERNEL=thin-plate",),
    # Wide ones make systems that amplify rounding; that of `quadric` is singular.
    *((f"RBF_KERNEL={name}", "INFLUENCE_FACTOR=0.2") for name in ("gaussian", "multiquadric")),
    ("RBF_KERNEL=inverse-quadric", "INFLUENCE_FACTOR=0.2"),
    ("RBF_KERNEL=inverse-multiquadric", "INFLUENCE_FACTOR=0.2"),
)
"""These on one sample in 2D only."""

FEW_METHODS = (
    ("SLIDING_MODE=none", "PERIODIC_MODE=none"),
    ("SLIDING_MODE=ps", "PERIODIC_MODE=fixed"),
    ("SLIDING_MODE=ds", "PERIODIC_MODE=moving"),
    REDUCED,
)
"""On samples that have no small size."""

FONT = "letters of the window: "
"""Before the name of the font, which is the machine's: with another one pictures differ."""

WINDOW = """
import sys, time
time.perf_counter = lambda: 0.0  # all runs take 0.00 s
from pathlib import Path
from tests.golden.window import main
main(Path(sys.argv[1]))
"""
"""A program of its own, whose screen is nobody else's."""

SHAPES = {"wide": "480x300", "flat": "480x320"}


def texts(desk: Desk) -> None:
    """Keep what explains the program: help and reference."""
    desk.run("--version")
    desk.run("--help")
    for name in COMMANDS:
        desk.run(name, "--help")
    desk.close("help")
    desk.run("keys")
    desk.run("sample")
    desk.close("keys")


def samples(desk: Desk) -> None:
    """Keep every sample: its case, its mesh, and what ``info`` and ``quality`` say of it."""
    for name in SIZES:
        for variant in VARIANTS.get(name, ("",)):
            made(desk, name, variant)
            folder = Path(f"{name}{variant}")
            desk.file(str(folder / f"{name}.cfg"))
            desk.file(str(folder / "mesh.su2"))
        desk.run("info", str(folder / "mesh.su2"))
        desk.run("info", str(folder / "mesh.su2"), "--json", "-")
        desk.close(name)


def made(desk: Desk, name: str, variant: str = "") -> str:
    """Write a sample into the current folder, and return the path of its case."""
    folder = f"{name}{variant}"
    more = ("--variant", variant) if variant else ()
    desk.run("sample", name, "--size", str(SIZES[name]), "-o", folder, *more)
    return f"{folder}/{name}.cfg"


def methods_2d(desk: Desk) -> None:
    """Keep the reports and meshes of 2D runs by every method."""
    for variant in VARIANTS["square"]:
        keep_run(desk, made(desk, "square", variant))
    case = "squarefile/square.cfg"
    for changed in (*METHODS, *MORE_METHODS):
        keep_run(desk, case, *changed)
    desk.close("square")
    for name in ("polar", "passage"):
        case = made(desk, name)
        for changed in ((), *METHODS):
            keep_run(desk, case, *changed)
        desk.close(name)
    case = made(desk, "turbine-row")
    for changed in FEW_METHODS:
        keep_run(desk, case, *changed)
    desk.close("turbine-row")


def methods_3d(desk: Desk) -> None:
    """Keep the reports and meshes of 3D runs by every method."""
    for variant in VARIANTS["hexahedron"]:
        keep_run(desk, made(desk, "hexahedron", variant))
    for changed in METHODS:
        keep_run(desk, "hexahedronfile/hexahedron.cfg", *changed)
    desk.close("hexahedron")
    for name, ways in (("cylindrical", ((), *METHODS)), ("stator", FEW_METHODS)):
        case = made(desk, name)
        for changed in ways:
            keep_run(desk, case, *changed)
        desk.close(name)


def keep_run(desk: Desk, case: str, *changed: str) -> None:
    """Deform, and keep report and mesh."""
    out = Path("out.su2")
    out.unlink(missing_ok=True)
    settings = [word for text in changed for word in ("--set", text)]
    steps = () if "STEPS=auto" in changed else ("--steps", "2")
    desk.run("run", case, *steps, *settings, "-o", str(out), "--json", "-")
    if out.exists():
        desk.file(str(out))


def reports(desk: Desk) -> None:
    """Keep what commands say on the terminal, and the files that they write."""
    case = made(desk, "passage")
    mesh = "passage/mesh.su2"
    steps = ("--steps", "3", "--steps-dir", "steps", "--history", "history.csv")
    desk.run("run", case, *steps, "--set", "DATA_REDUCTION=YES", "--json", "report.json")
    for name in ("history.csv", "report.json", "steps/mesh_2.su2"):
        desk.file(name)
    desk.run("run", case, "--steps", "2", "-o", "out.su2")
    stiff = ("--set", "SLIDING_MODE=none", "--set", "PERIODIC_MODE=none")
    desk.run("run", case, "--steps", "1", *stiff, "-o", "bad.su2")
    desk.run("run", case, "-q", "--steps", "1", "-o", "quiet.su2")
    for more in ((), ("--reference", mesh), ("--case", case), ("--metric", "rbf-slide")):
        desk.run("quality", "out.su2", *more)
    desk.run("quality", "out.su2", "--reference", mesh, "--json", "-")
    desk.run("quality", "bad.su2", "--reference", mesh, "-o", "quality.csv")
    desk.say("quality.csv, its first rows:")
    desk.say("\n".join(Path("quality.csv").read_text().splitlines()[:20]))
    desk.close("reports")


def formats(desk: Desk) -> None:
    """Keep what is left of a mesh that was written in each format and read again."""
    for name in ("square", "cylindrical"):
        case = made(desk, name)
        desk.run("run", case, "--steps", "1", "-q", "-o", "first.su2")
        for ending in ("vtu", "vtk", "xdmf", "med", "msh", "inp", "vol", "mesh", "bdf", "stl"):
            file = f"{name}.{ending}"
            if desk.run("run", case, "--steps", "1", "-q", "-o", file) == 0:
                desk.run("info", file, "--json", "-")
                desk.run("quality", file)
    desk.close("formats")


def mistakes(desk: Desk) -> None:
    """Keep what the program says to typical mistakes."""
    case = made(desk, "square")
    mesh = "square/mesh.su2"
    text = Path(mesh).read_text()
    wrong = {
        "short.su2": text[: len(text) // 2],
        "element.su2": text.replace("\n9 ", "\n22 ", 1),
        "node.su2": text.replace("\n9 0", "\n9 9999", 1),
        "empty.su2": "",
        "unknown.cfg": Path(case).read_text() + "STEPPS= 3\n",
        "twice.cfg": Path(case).read_text() + "STEPS= 3\n",
        "marker.cfg": Path(case).read_text().replace("BLOCK", "BLOK"),
        "value.cfg": Path(case).read_text().replace("= ps", "= sliding"),
    }
    for name, content in wrong.items():
        (Path("square") / name).write_text(content)
    for name in wrong:
        desk.run("run" if name.endswith(".cfg") else "info", f"square/{name}")
    for words in (
        ["run"],
        ["runn"],
        ["run", case, "--nonsense"],
        ["run", "missing.cfg"],
        ["run", mesh],
        ["run", case, "--set", "STEPS"],
        ["run", case, "--set", "STEPS=0"],
        ["run", case, "--set", "STEPS=many"],
        ["run", case, "--set", "PERIODIC_MODE=move"],
        ["run", case, "--set", "RBF_KERNEL=wendland-c3"],
        ["run", case, "--set", "MARKER_MOVING=(BLOCK, LEFT)"],
        ["run", case, "--set", "MARKER_PERIODIC=(LOWER, LEFT)"],
        ["run", case, "--set", "DEFORMATION_FILENAME=none.txt"],
        ["run", case, "--set", "MOTION=(BLOCK, turn, 3)"],
        ["run", case, "--set", "MOTION=(BLOCK, translate, 3)"],
        ["run", case, "-o", mesh],
        ["run", case, "-o", "none/a.su2"],
        ["run", case, "-o", "a.xyz"],
        ["run", case, "--picture", "a.jpg"],
        ["run", case, "--picture", "a.png", "--picture-size", "large"],
        ["run", case, "--picture", "a.png", "--zoom", "9,9,0.1"],
        ["run", case, "--zone", "2"],
        ["info", "missing.su2"],
        ["info", case],
        ["quality", mesh, "--reference", case],
        ["section", mesh, "-o", "a.png"],
        ["section", mesh, "--plane", "w=3", "-o", "a.png"],
        ["section", mesh, "--plane", "y=9", "-o", "a.png"],
        ["section", mesh, "--plane", "0,0,0,0", "-o", "a.png"],
        ["section", mesh, "--cylinder", "-1", "-o", "a.png"],
        ["section", mesh, "--plane", "y=0.2", "-o", "a.bmp"],
        ["section", mesh, "--plane", "y=0.2", "--size", "10x10", "-o", "a.png"],
        ["film", case, "-o", "a.avi"],
        ["film", case, "-o", "a.gif", "--fps", "0"],
        ["film", case, "-o", "a.gif", "--beside", "MESH_FILENAME=b.su2"],
        ["compare", case, "--methods", "some"],
        ["compare", case, "--periodic", "often"],
        ["compare", case, "--steps", "0"],
        ["sample", "sqare"],
        ["sample", "square", "--variant", "other"],
        ["sample", "square", "--size", "0", "-o", "new"],
        ["sample", "square", "-o", "square"],
        ["nothing.su2"],
    ):
        desk.run(*words)
    desk.close("mistakes")


def comparison(desk: Desk) -> None:
    """Keep tables, plots and pictures of ``compare``."""
    case = made(desk, "passage")
    with patch("time.process_time", side_effect=count(0.0, 0.25)):  # a plot shows it
        ways = ("--methods", "all", "--periodic", "none,moving", "--steps", "1,3")
        desk.run("compare", case, *ways, "-o", "2d")
        ways = ("--set", "DATA_REDUCTION=YES", "--methods", "none,ds", "--steps", "auto")
        desk.run("compare", made(desk, "cylindrical"), *ways, "-o", "3d")
    for path in (*sorted(Path("2d").iterdir()), *sorted(Path("3d").iterdir())):
        name = f"{path.parent}_{path.stem}"
        if path.suffix in (".csv", ".svg"):
            desk.file(str(path))
        elif path.suffix == ".png" and "_01_" not in name:
            desk.picture(path, name, part=0.2 if "3d_quality" in name else 0.3)
    desk.close("compare")


SU2 = """\
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
SOLUTION_ADJ_FILENAME= adj.dat
OBJECTIVE_FUNCTION= DRAG
DV_MARKER= ( BLOCK )
DV_KIND= TRANSLATION, ROTATION
DV_PARAM= (1, 0.5, 0); (0.5, 0.5, 0, 0.5, 0.5, 1)
DV_VALUE= 0.01, 3.0
"""
"""A configuration of SU2 for the sample square."""


def designs(desk: Desk) -> None:
    """Keep a sweep, and what ``def`` and ``dot`` make of a configuration of SU2."""
    case = made(desk, "square")
    Path("mesh.su2").write_text(Path("square/mesh.su2").read_text())
    Path("table.csv").write_text("SLIDING_MODE,STEPS\nps,1\nds,2\n")
    desk.run("sweep", case, "--columns")
    desk.run("sweep", case, "table.csv", "-o", "swept", "--workers", "1", "-q")
    desk.file("swept/results.csv")
    Path("su2.cfg").write_text(SU2)
    desk.run("def", "su2.cfg", "--json", "-")
    desk.file("out.su2")
    rows = mesh_points(Path("out.su2").read_text())
    head = '"PointID", "x", "y", "Adj_Density", "Sensitivity_x", "Sensitivity_y"'
    values = [f"{k}, {x!r}, {y!r}, 1.0, {y * y!r}, {x!r}" for k, (x, y) in enumerate(rows)]
    Path("adj_cd.csv").write_text("\n".join([head, *values]) + "\n")
    desk.run("dot", "su2.cfg", "--json", "-")
    desk.file("of_grad.dat")
    desk.close("designs")


def mesh_points(text: str) -> list[tuple[float, float]]:
    """Return the points of a 2D mesh."""
    lines = text.splitlines()
    begin = next(k for k, line in enumerate(lines) if line.startswith("NPOIN="))
    count = int(lines[begin].split()[1])
    rows = (line.split() for line in lines[begin + 1 : begin + 1 + count])
    return [(float(x), float(y)) for x, y, *_ in rows]


def pictures(desk: Desk) -> None:
    """Keep the pictures of ``run``."""
    for name in ("passage", "square", "polar", "cylindrical", "stator"):
        case = made(desk, name)
        for more in ((), ("--zoom", "0.3,0.1,0.6")) if name == "passage" else ((),):
            path = f"{name}{'_near' * bool(more)}.png"
            drawn = ("--picture", path, "--picture-size", SHAPES["wide"], *more)
            desk.run("run", case, "--steps", "3", "-o", "out.su2", *drawn)
            desk.picture(path)
    desk.run("run", "square/square.cfg", "--steps", "1", "--set", "SLIDING_MODE=none", "-q",
             "--set", "PERIODIC_MODE=none", "-o", "out.su2", "--picture", "inverted.png",
             "--picture-size", SHAPES["wide"])  # fmt: skip
    desk.picture("inverted.png")
    desk.close("pictures")


def sections(desk: Desk) -> None:
    """Keep pictures and drawings of sections."""
    for name in ("passage", "cylindrical", "stator"):
        desk.run("run", made(desk, name), "-q", "--steps", "3", "-o", f"{name}.su2")

    def cut(name: str, of: str, *words: str) -> None:
        path = f"{name}.png"
        base = ("--case", f"{of}/{of}.cfg")
        desk.run("section", f"{of}.su2", *words, *base, "--size", SHAPES["flat"], "-o", path)
        desk.picture(path)

    cut("line_curve", "passage", "--plane", "y=0.1")
    cut("line_whole", "passage", "--plane", "1,0.2,0.5,0.1", "--whole", "--copies", "1")
    cut("circle", "passage", "--cylinder", "0.3,z", "--whole")
    cut("plane", "cylindrical", "--plane", "z=0.4")
    cut("plane_whole", "cylindrical", "--plane", "z=0.4", "--whole", "--3d")
    cut("plane_moved", "cylindrical", "--plane", "z=0.5", "--color", "displacement")
    cut("cylinder", "stator", "--cylinder", "0.275", "--copies", "1", "--json", "cut.json")
    cut("cylinder_space", "stator", "--cylinder", "0.275", "--3d", "--map", "plasma")
    cut("cylinder_wheel", "stator", "--cylinder", "0.275,z", "--3d", "--copies", "wheel")
    cut("cone", "stator", "--cone", "10,z,0,0,-1.5", "--copies", "1")
    cut("cone_space", "stator", "--cone", "10,z,0,0,-1.5", "--3d", "--copies", "2", "--whole")
    cut("cylinder_range", "stator", "--cylinder", "0.26", "--range", "0.75,0.95", "--no-edges",
        "--color", "skew", "--map", "gray")  # fmt: skip
    desk.file("cut.json")
    for ending in ("svg", "pdf"):
        for name, words in (
            ("stator", ("--cylinder", "0.275")),
            ("cylindrical", ("--plane", "z=0.4", "--whole")),
            ("passage", ("--plane", "y=0.1")),
        ):
            path = f"{name}.{ending}"
            desk.run("section", f"{name}.su2", *words, "--case", f"{name}/{name}.cfg", "-o", path)
            desk.file(path)
    desk.close("sections")


def films(desk: Desk) -> None:
    """Keep images of films of every kind."""
    passage, round_ = made(desk, "passage"), made(desk, "cylindrical")
    shape = ("--size", SHAPES["wide"])
    desk.run("film", passage, "--steps", "3", "--between", "1", *shape, "-o", "film.gif")
    with Image.open("film.gif") as film:
        desk.say(f"film.gif: {film.n_frames} images of {film.width}x{film.height}")
        for at in (0, film.n_frames - 1):
            film.seek(at)
            desk.say(f"  image {at} stays {film.info['duration']} ms")
            keep_picture(film, desk.folder / f"gif_{at}.png")
    pair = ("--beside", "SLIDING_MODE=none", "--beside", "PERIODIC_MODE=none")
    desk.run("film", passage, "--steps", "2", *pair, *shape, "-o", "beside_%02d.png")
    moved = ("--color", "displacement")
    desk.run("film", round_, "--steps", "2", *moved, *shape, "-o", "moved_%02d.png")
    skew = ("--color", "skew", "--zoom", "0.3,0.1,0.8")
    desk.run("film", passage, "--steps", "2", *skew, *shape, "-o", "skew")
    for path in ("beside_02.png", "moved_02.png"):
        desk.picture(path)
    named = sorted(path.name for path in (*Path().glob("*_??.png"), *Path("skew").iterdir()))
    desk.say(f"pictures: {', '.join(named)}")
    desk.picture(max(Path("skew").iterdir()), "skew")
    desk.run("film", passage, "--steps", "2", *shape, "-o", "film.mp4")
    desk.close("films")


def window(desk: Desk) -> None:
    """Keep the states of the window, its menus, tips and dialogs."""
    done = subprocess.run(
        [sys.executable, "-c", WINDOW, str(desk.folder)],
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # repair makes rounding visible
    )
    assert done.returncode == 0, done.stderr


PARTS: dict[str, Callable[[Desk], None]] = {
    part.__name__: part
    for part in (
        *(texts, samples, methods_2d, methods_3d, reports, formats, mistakes),
        *(designs, comparison, pictures, sections, films, window),
    )
}
"""By name, which is that of the folder in ``kept/``."""

QUICK = ("texts", "reports")
"""Parts that the fast tests compare, too."""
