"""``slideviz doctor``: what this installation and machine have, what is missing, and its remedy."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator
from importlib import metadata
from math import isfinite
from pathlib import Path

from slideviz import __version__
from slideviz.cli.terminal import DONE
from slideviz.errors import CaseError
from slideviz.system.atomic import write_whole
from slideviz.system.missing_libraries import OPENGL, apt_install, missing_for_window
from slideviz.system.platform import free_memory, needs_server

Problem = tuple[str, str]
"""What is missing or wrong, and the line that mends it."""
Rows = Iterator[tuple[str, object]]

LEAST_MEMORY = 2 << 30  # bytes below which a window with a small mesh may not start
LEAST_DISK = 1 << 29  # bytes; compiled loops take a tenth of it
FONTS = ("/usr/share/fonts", "/usr/local/share/fonts")
EXTRAS = ("mpi4py", "openmdao", "distributed", "cupy-cuda12x")
"""Packages of extras, without which all but their features works."""


class Report:
    """The sections of the report, and the problems found on the way."""

    def __init__(self, shown: bool) -> None:
        self.shown = shown  # whether each section is printed as soon as it is known
        self.sections: dict[str, dict[str, object]] = {}
        self.problems: list[Problem] = []

    def add(self, name: str, look: Callable[[Report], Rows]) -> None:
        """Add the rows of a section; that it cannot be examined is a problem."""
        rows: dict[str, object] = {}
        try:
            rows.update(look(self))
        except Exception as problem:  # one broken library must not hide what else there is
            words = f"{name}: {type(problem).__name__}: {problem}"
            self.problems.append((words, "pip install --force-reinstall slideviz"))
        self.sections[name] = rows
        if self.shown:
            print(f"{name}:")
            for row, value in rows.items():
                print(f"  {row:<18} {value}")


def main(arguments: Namespace) -> int:
    """Print what is there and what is missing, or write it as JSON; return the exit code."""
    to_terminal = str(arguments.json) == "-"
    report = Report(shown=not to_terminal)
    for name, look in SECTIONS.items():
        report.add(name, look)
    if report.shown:
        print("missing:" if report.problems else "nothing is missing")
        for what, remedy in report.problems:
            print(f"  {what}\n    {remedy}")
    problems = [{"problem": what, "remedy": remedy} for what, remedy in report.problems]
    text = json.dumps({**report.sections, "problems": problems}, indent=2, default=str)
    if to_terminal:
        print(text)
    elif arguments.json is not None:
        write_whole(arguments.json, f"{text}\n", CaseError)
    return DONE


def _program(_: Report) -> Rows:
    frozen = ", in a folder of its own" if getattr(sys, "frozen", False) else ""
    yield "slideviz", f"{__version__}, {Path(__file__).parents[1]}"
    yield "Python", f"{platform.python_version()}{frozen}, {sys.executable}"
    yield "system", platform.platform()


def _packages(report: Report) -> Rows:
    needed = [line for line in metadata.requires("slideviz") or () if "extra ==" not in line]
    for name in dict.fromkeys(re.split(r"[^\w.-]", line)[0] for line in needed):
        try:
            yield name, metadata.version(name)
        except metadata.PackageNotFoundError:
            yield name, "missing"
            report.problems.append((f"the package {name} is not installed", f"pip install {name}"))
    for name in EXTRAS:
        try:
            yield name, metadata.version(name)
        except metadata.PackageNotFoundError:
            yield name, "not installed (optional)"
    yield "mpirun", shutil.which("mpirun") or "not installed (optional)"


def _threads(_: Report) -> Rows:
    # Late: Numba takes 0.3 s, and may be missing.
    import scipy.linalg  # noqa: F401  # loads its BLAS
    from threadpoolctl import threadpool_info

    from slideviz.system.threads import cores

    yield "cores", os.cpu_count()
    yield "compiled loops", cores()
    for pool in threadpool_info():
        build = " ".join(filter(None, (pool["version"], pool.get("architecture"))))
        words = ", ".join(filter(None, (f"{pool['num_threads']} threads", build)))
        yield f"{pool['user_api']} of {pool['prefix']}", words


def _memory(report: Report) -> Rows:
    free = free_memory()
    yield "free", _size(free)
    if free < LEAST_MEMORY:
        remedy = "close other programs; meshes in memory take about 1 GB for a million cells"
        report.problems.append((f"only {_size(free)} of memory are free", remedy))


def _caches(report: Report) -> Rows:
    # Late: Numba takes 0.3 s, and may be missing.
    from slideviz.rbf.compiled import sum_plain

    folder = Path(sum_plain._cache.cache_path)
    yield "compiled loops", folder
    yield "files there", len(list(folder.glob("*.nbc")))
    for name, place in (("compiled loops", folder), ("temporary files", tempfile.gettempdir())):
        there = next(parent for parent in (Path(place), *Path(place).parents) if parent.exists())
        free = shutil.disk_usage(there).free
        yield f"free for {name}", _size(free)
        if free < LEAST_DISK:
            remedy = f"free some space in {there}"
            report.problems.append((f"only {_size(free)} are free for {name}", remedy))


def _drawing(report: Report) -> Rows:
    # Late: VTK takes 0.6 s, and may be missing.
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    from slideviz.export.offscreen import display_fault, has_opengl

    if needs_server():
        yield "display", display_fault() or os.environ.get("DISPLAY") or "Wayland"
        has_fonts = any(any(Path(folder).rglob("*.[to]tf")) for folder in FONTS)
        yield "fonts", "some" if has_fonts else "none"
        if not has_fonts:
            remedy = apt_install(("fontconfig-config", "fonts-dejavu-core"))
            report.problems.append(("the window finds no font for its letters", remedy))
    if missing := missing_for_window():
        yield "window", "missing libraries"
        words = "the window lacks libraries of the system"
        report.problems.append((words, apt_install(missing)))
    if not has_opengl():
        yield "OpenGL", "missing"
        words = "pictures, films and the window lack OpenGL"
        report.problems.append((words, apt_install(OPENGL)))
        return
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.Render()
    able = window.ReportCapabilities()
    for name in ("vendor", "renderer", "version"):
        found = re.search(rf"OpenGL {name} string: +(.*)", able)
        yield f"OpenGL {name}", found[1] if found else "unknown"
    software = re.search(r"llvmpipe|softpipe|swrast|SWR", able)
    yield "GPU", "none used: OpenGL draws in software" if software else "used for drawing"


def _computing(_: Report) -> Rows:
    # Late: SciPy takes 0.1 s, and may be missing.
    from slideviz.system.device import card_name, why_no_card

    yield "GPU", f"none used: {lacking}" if (lacking := why_no_card()) else card_name()


def _size(count: float) -> str:
    return f"{count / 2**30:.1f} GiB" if isfinite(count) else "unknown"


SECTIONS = {
    "program": _program,
    "packages": _packages,
    "threads": _threads,
    "computing": _computing,
    "memory": _memory,
    "caches": _caches,
    "drawing": _drawing,
}
"""What is examined, in the order of the output; what may crash comes last."""
