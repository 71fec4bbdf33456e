"""Smoke test of the package: a wheel is built, installed outside of the clone, and used.

First with the packages of `COMPUTING` only, as on a cluster: no Qt, no VTK. Then with all of them.
Packages are links to those of the environment that runs this, so that nothing is downloaded but
what builds the wheel.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]

COMPUTING = "numpy scipy numba scikit-fem pyamg threadpoolctl meshio h5py orjson filelock"
PLOTS = "matplotlib"
"""What sections and the plots of comparisons are drawn with."""
PICTURES = "pyvista vtk pillow imageio-ffmpeg"
WINDOW = "pyvistaqt qtpy PySide6_Essentials"

CONFIG = """
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= moved.su2
MARKER_PERIODIC= (LOWER, UPPER, 0, 0, 0, 0, 0, 0, 0, 1, 0)
MARKER_SYM= (LEFT, RIGHT)
DV_MARKER= (BLOCK)
DV_KIND= TRANSLATION
DV_PARAM= (1.0, 0.0, 0.0)
DV_VALUE= 0.01
OBJECTIVE_FUNCTION= DRAG
SOLUTION_ADJ_FILENAME= solution_adj
"""

LIBRARY = """
import sys
from pathlib import Path

import numpy as np

import slideviz as sv

assert not Path(sv.__file__).is_relative_to(sys.argv[1]), sv.__file__
mesh, case = sv.read("mesh.su2"), sv.Case.read("square.cfg").change(steps=1)
*_, last = sv.deform(case, mesh)
sv.write("again.su2", last.mesh)
print(sv.quality(last.mesh, reference=mesh).min)
deformer = sv.Deformer(mesh, case)
assert np.array_equal(deformer.as_run(), last.mesh.points)
gradient = deformer.vjp(deformer.displacement, np.ones(mesh.points.shape))
assert gradient.shape == deformer.displacement.shape
names = '"PointID", "x", "y", "Sensitivity_x", "Sensitivity_y"'
table = np.column_stack([np.arange(len(mesh.points)), mesh.points, np.cos(mesh.points)])
np.savetxt("solution_adj_cd.csv", table, delimiter=", ", header=names, comments="", fmt="%.17g")
if __name__ == "__main__":
    assert len(list(sv.sweep(case, {"STEPS": [1, 2]}, mesh=mesh, workers=1))) == 2
loaded = {"pyvista", "vtkmodules", "PySide6", "pyvistaqt", "matplotlib"} & set(sys.modules)
assert not loaded, loaded
"""

MODULES = """
import importlib, pkgutil, slideviz

DRAWING = ("gui", "scene", "export", "plots", "study")
DRAWN_BY = ("film", "picture", "report", "section")

def needs_more(name):
    if name.endswith(("openmdao", *(f"{one}_command" for one in DRAWN_BY))):
        return True
    return name.split(".")[1] in DRAWING

for module in pkgutil.walk_packages(slideviz.__path__, "slideviz.", onerror=needs_more):
    if not needs_more(module.name):
        importlib.import_module(module.name)
"""

COMPUTED = (
    "sample square --size 12 -o . --force",
    "run square.cfg --steps 1 -q --json report.json",
    "info mesh.su2",
    "quality mesh.su2 -o quality.csv",
    "convert mesh.su2 mesh.vtu",
    "info mesh.vtu",
    "convert mesh.su2 mesh.vtkhdf",
    "convert mesh.su2 mesh.msh",
    "convert mesh.su2 mesh.su2b",
    "run square.cfg --steps 1 -q --set MESH_FILENAME=mesh.su2b -o streamed.su2b --stream",
    "repair mesh.su2 -o repaired.su2",
    "gap square.cfg --between BLOCK,UPPER --steps 1 -q",
    "sweep square.cfg designs.csv -o swept --workers 1 -q",
    "keys",
    "def config.cfg -q",
    "dot config.cfg -q",
)
PLOTTED = (
    "section mesh.su2 --plane y=0.4 -o section.png",
    "section mesh.su2 --plane y=0.4 -o section.svg",
    "section mesh.su2 --plane y=0.4 -o section.pdf",
    "compare square.cfg --methods ps --steps 1 --no-pictures -q -o compared",  # compiles most
)
DRAWN = (
    "run square.cfg --steps 1 -q -o drawn.su2 --picture drawn.png",
    "film square.cfg --steps 1 -q -o film.gif",
    "picture square.cfg -q -o picture.png",
    "report square.cfg -q -o report.html",
    "compare square.cfg --methods ps --steps 1 -q -o pictures",
)


def requirements(names: Iterable[str]) -> Iterator[str]:
    """Yield names of packages and, over and over, of those that they need."""
    for name in names:
        yield name
        try:
            needed = distribution(name).requires or ()
        except PackageNotFoundError:  # for another platform or an older Python
            continue
        yield from requirements(re.split(r"[^\w.-]", one)[0] for one in needed if ";" not in one)


def link(names: str, packages: Path) -> None:
    """Link packages of this environment, with all that they need, into another one."""
    here = Path(sysconfig.get_path("purelib"))
    for name in requirements(names.split()):
        for file in distribution(name).files or ():
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (packages / top).exists():
                (packages / top).symlink_to(here / top)


def install(folder: Path) -> Path:
    """Build the wheel and install it alone into a new environment; return that one's packages."""
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", folder, ROOT], check=True)
    (wheel,) = folder.glob("slideviz-*.whl")
    venv.create(folder / "venv", symlinks=True)
    subprocess.run([*pip, "--python", folder / "venv", "install", "--no-deps", wheel], check=True)
    (packages,) = folder.glob("venv/lib/python*/site-packages")
    return packages


class Commands:
    """The commands of an environment, run in a folder."""

    def __init__(self, programs: Path, folder: Path) -> None:
        self.programs, self.folder = programs, folder
        self.variables = {**os.environ, "PYTHONPATH": "", "DISPLAY": "", "WAYLAND_DISPLAY": ""}

    def run(self, words: str, *more: str) -> subprocess.CompletedProcess:
        """Run a command, print how long it took, and return its result."""
        begin = time.monotonic()
        program, *rest = words.split()
        done = subprocess.run(
            [self.programs / program, *rest, *more],
            cwd=self.folder,
            env=self.variables,
            capture_output=True,
            text=True,
            check=False,
        )
        sys.stdout.write(f"smoke: {time.monotonic() - begin:5.1f} s  {words}\n")
        sys.stdout.flush()
        return done

    def require(self, words: str, *more: str) -> None:
        """Run a command, and end the program if it fails."""
        done = self.run(words, *more)
        if done.returncode not in (0, 3):  # 3: done, but cells are inverted
            sys.exit(f"smoke: {words} ended with {done.returncode}\n{done.stdout}{done.stderr}")

    def require_refusal(self, words: str, packages: str) -> None:
        """Run a command, and end the program unless its last line says what to install."""
        done = self.run(words)
        said = done.stderr.endswith(f"which is not installed; use `pip install {packages}`\n")
        if done.returncode != 1 or not said:
            sys.exit(f"smoke: {words} does not say that {packages} are missing\n{done.stderr}")


def main() -> None:
    """Install and try."""
    with TemporaryDirectory(prefix="slideviz-smoke-") as temporary:
        folder, work = Path(temporary), Path(temporary) / "work"
        work.mkdir()
        packages = install(folder)
        commands = Commands(folder / "venv" / "bin", work)
        link(COMPUTING, packages)
        (work / "designs.csv").write_text("STEPS\n1\n2\n")
        (work / "config.cfg").write_text(CONFIG)
        (work / "library.py").write_text(LIBRARY)
        sample, *others = COMPUTED
        commands.require(f"slideviz {sample}")
        commands.require("python library.py", str(ROOT))
        commands.require("python -c", MODULES)
        for words in others:
            commands.require(f"slideviz {words}")
        for words in PLOTTED:
            commands.require_refusal(f"slideviz {words}", PLOTS)
        link(PLOTS, packages)
        for words in PLOTTED[:-1]:
            commands.require(f"slideviz {words}")
        for words in DRAWN:
            commands.require_refusal(f"slideviz {words}", PICTURES)
        link(PICTURES, packages)
        for words in DRAWN[:-1]:
            commands.require(f"slideviz {words}")
        commands.require("python -c", "import importlib.util as u; assert not u.find_spec('qtpy')")
        link(WINDOW, packages)
        commands.require("python -c", "import slideviz.gui.window")
    sys.stdout.write("smoke: the wheel works\n")


if __name__ == "__main__":
    main()
