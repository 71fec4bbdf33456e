"""The runs: small meshes by formula, and cases of every method, mode and dimension.

Each run is a mesh and the lines of a case. Its hash is that of the points of all its steps.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import llvmlite.binding
import numpy as np
from threadpoolctl import threadpool_info

import slideviz as sv
from slideviz.case.cfg import case_of_text
from slideviz.case.model import Case
from slideviz.mesh.model import Mesh
from slideviz.system.ranks import thread_limit
from slideviz.terms import KERNELS, STIFFNESS_TYPES
from tests import builders

_BOX = """MARKER_MOVING= ( BLOCK )
MARKER_SLIDING= ( x_m, x_p{0} )
MARKER_PERIODIC= ( y_m, y_p )
PERIODIC_TYPE= translational
MOTION= (BLOCK, translate, 0.03, 0.05{1}) ; (BLOCK, scale, 1.05, centroid)
STEPS= 2
"""
BOX = {2: _BOX.format("", ""), 3: _BOX.format(", z_m, z_p", ", 0.02")}
WALLS = {
    dim: case.replace("x_p", "x_p, y_m, y_p").replace("MARKER_PERIODIC= ( y_m, y_p )\n", "")
    for dim, case in BOX.items()
}
SECTOR = """MARKER_MOVING= ( BLOCK )
MARKER_SLIDING= ( inner, outer )
MARKER_PERIODIC= ( per1, per2 )
MOTION= (BLOCK, translate, 0.01, 0.02)
STEPS= 2
"""
PASSAGE = """MARKER_MOVING= ( blade )
MARKER_SLIDING= ( hub, shroud, inflow, outflow )
MARKER_PERIODIC= ( per1, per2 )
MOTION= (blade, rotate, 2, z, 0, 0, 0)
STEPS= 2
"""
BENT = """MARKER_MOVING= ( BLOCK )
MARKER_SLIDING= ( inner, outer, per1, per2 )
MOTION= (BLOCK, rotate, 5, centroid)
SLIDING_MODE= ds
CURVED= yes
"""
REDUCED = "DATA_REDUCTION= YES\nDATA_RED_TOLERANCE= 1e-4\n"
FOLDED = {
    dim: case.replace("0.03, 0.05", "0.12, 0.16").replace("STEPS= 2", "STEPS= 1")
    for dim, case in WALLS.items()
}
FFD = """MARKER_MOVING= ( BLOCK )
FFD_DEFINITION= (BOX, .2, .2, 0, .8, .2, 0, .8, .8, 0, .2, .8, 0{})
FFD_DEGREE= (3, 2, 0)
MOTION= (BLOCK, ffd, BOX, 1, 1, 0, 0.05, 0.04, 0) ; (BLOCK, ffd-camber, BOX, 2, 0.02)
""".format(", 0" * 12)
AIRFOIL = """MARKER_MOVING= ( airfoil )
MOTION= (airfoil, hicks-henne, upper, 0.3, 0.01) ; (airfoil, cst, lower, 1, 4, 0.01)
"""
ZONES = """MARKER_MOVING= ( 1:BLOCK )
MARKER_SLIDING= ( 1:y_m, 1:y_p, 2:y_m, 2:y_p )
MOTION= (1:BLOCK, translate, 0.02, 0.03)
"""


@dataclass(frozen=True)
class BitsRun:
    """A mesh, the lines of a case, and what is done with them."""

    mesh: Callable[[], Mesh]
    case: str
    points: Callable[[Case, Mesh], Iterator[np.ndarray]]
    """Yields arrays whose bits are kept."""

    def hash(self) -> str:
        """Return a text that differs where a bit does."""
        content = blake2b(digest_size=12)
        with thread_limit(1) as limit:
            limit()
            mesh = self.mesh()
            for values in self.points(case_of_text(Path("a.cfg"), self.case, Case()), mesh):
                content.update(np.ascontiguousarray(values).tobytes())
        return content.hexdigest()


def _deformed(case: Case, mesh: Mesh) -> Iterator[np.ndarray]:
    for step in sv.deform(case, mesh):
        yield step.mesh.points


def _derived(case: Case, mesh: Mesh) -> Iterator[np.ndarray]:
    deformer = sv.Deformer(mesh, case)
    yield deformer.as_run()
    yield deformer.vjp(deformer.displacement, np.cos(mesh.points))


def _streamed(case: Case, mesh: Mesh) -> Iterator[np.ndarray]:
    # Late: only here.
    from slideviz.streaming.run import stream

    with TemporaryDirectory() as folder:
        source, target = Path(folder, "a.su2b"), Path(folder, "b.su2b")
        sv.write(source, mesh)
        stream(case.change(mesh_file=source), target)
        yield sv.read(target).points


def _measured(case: Case, mesh: Mesh) -> Iterator[np.ndarray]:
    *_, last = sv.deform(case, mesh)
    yield sv.quality(last.mesh, reference=mesh).values
    yield np.array([sv.safe_fraction(case, mesh).fraction])


@cache
def _box(dim: int, kind: str = "plain", hole: bool = True) -> Mesh:
    return builders.square(8, kind, hole) if dim == 2 else builders.cube(4, kind, hole)


def _zones() -> Mesh:
    one = builders.square(6)
    two = one.with_points(one.points + np.array([1.0, 0.0]))
    return builders.join_zones([replace(m, zone=k, zones=2) for k, m in enumerate((one, two), 1)])


def _modes() -> Iterator[tuple[str, BitsRun]]:
    meshes = {
        "box 2D": (lambda: _box(2), BOX[2]),
        "box 3D": (lambda: _box(3, "mixed"), BOX[3]),
        "sector 2D": (lambda: builders.sector(6), SECTOR),
        "passage 3D": (lambda: builders.passage((3, 4, 4)), PASSAGE),
    }
    for name, (mesh, case) in meshes.items():
        for sliding in ("none", "ps", "ds"):
            for periodic in ("none", "periodic", "fixed", "moving"):
                if (sliding, periodic) != ("none", "moving"):
                    modes = f"SLIDING_MODE= {sliding}\nPERIODIC_MODE= {periodic}\n"
                    yield f"{name}, {sliding}, {periodic}", BitsRun(mesh, case + modes, _deformed)


def _others() -> Iterator[tuple[str, BitsRun]]:
    for kernel, term in KERNELS.items():
        factor = "" if term.compact else "INFLUENCE_FACTOR= 0.5\n"
        yield (
            f"kernel {kernel}",
            BitsRun(lambda: _box(2), f"{WALLS[2]}RBF_KERNEL= {kernel}\n{factor}", _deformed),
        )
    yield "polynomial", BitsRun(lambda: _box(2), f"{WALLS[2]}POLYNOMIAL= yes\n", _deformed)
    for dim in (2, 3):
        for levels in ("", "MULTILEVEL= YES\n"):
            case = f"{WALLS[dim]}{REDUCED}{levels}SLIDING_MODE= ps\n"
            yield (
                f"reduction {dim}D {levels[:10]}".strip(),
                BitsRun(lambda d=dim: _box(d), case, _deformed),
            )
        yield f"idw {dim}D", BitsRun(lambda d=dim: _box(d), f"{WALLS[dim]}METHOD= idw\n", _deformed)
        relaxed = f"{WALLS[dim]}SLIDING_MODE= ps\nRELAX= yes\n"
        yield f"relaxed {dim}D", BitsRun(lambda d=dim: _box(d), relaxed, _deformed)
        repaired = f"{FOLDED[dim]}REPAIR= yes\nREPAIR_BELOW= 0.3\n"
        yield f"repaired {dim}D", BitsRun(lambda d=dim: _box(d, "simplex"), repaired, _deformed)
    for stiffness in STIFFNESS_TYPES:
        case = f"{WALLS[2]}METHOD= elastic\nDEFORM_STIFFNESS_TYPE= {stiffness}\n"
        yield f"elastic {stiffness}", BitsRun(lambda: _box(2, "mixed"), case, _deformed)
    yield "elastic 3D", BitsRun(lambda: _box(3), f"{WALLS[3]}METHOD= elastic\n", _deformed)
    layered = "MARKER_MOVING= ( airfoil )\nMOTION= (airfoil, rotate, 3, 0, 0)\nLAYERS= keep\n"
    yield "layers", BitsRun(lambda: builders.airfoil(24, 5), layered, _deformed)
    yield "curved", BitsRun(lambda: builders.sector(6), BENT, _deformed)
    yield (
        "steps auto",
        BitsRun(lambda: _box(2), WALLS[2].replace("STEPS= 2", "STEPS= auto"), _deformed),
    )
    yield "zones", BitsRun(_zones, ZONES, _deformed)
    yield "box of control points", BitsRun(lambda: _box(2), FFD, _deformed)
    yield "airfoil", BitsRun(lambda: builders.airfoil(24, 5), AIRFOIL, _deformed)
    rims = PASSAGE.replace("rotate, 2, z, 0, 0, 0", "translate, 0.01, 0.02, 0.01") + "RIMS= slide\n"
    yield "rims", BitsRun(lambda: builders.passage((3, 4, 4)), rims, _deformed)
    derived = f"{BOX[2]}SLIDING_MODE= ds\nPERIODIC_MODE= moving\n"
    yield "derivatives", BitsRun(lambda: _box(2), derived, _derived)
    yield "streamed", BitsRun(lambda: _box(3), f"{WALLS[3]}SLIDING_MODE= ps\n", _streamed)
    yield "quality and safe fraction", BitsRun(lambda: _box(3, "mixed"), WALLS[3], _measured)


RUNS: dict[str, BitsRun] = dict([*_modes(), *_others()])
"""The runs by name."""


def made_with() -> dict[str, str]:
    """Return the versions of all that may change a bit of a result, and the processor."""
    blas = sorted(
        f"{one.get('internal_api')} {one.get('version')} {one.get('architecture', '')}".strip()
        for one in threadpool_info()
        if one["user_api"] == "blas"
    )
    return {
        **{name: version(name) for name in ("numpy", "scipy", "numba", "llvmlite", "pyamg")},
        "BLAS": ", ".join(dict.fromkeys(blas)),
        "processor": llvmlite.binding.get_host_cpu_name(),
        "features": blake2b(str(_features()).encode(), digest_size=6).hexdigest(),
        "C library": " ".join(platform.libc_ver()),
    }


def _features() -> list[str]:
    """Return what the processor can do, by which NumPy and Numba choose their loops."""
    return sorted(k for k, there in llvmlite.binding.get_host_cpu_features().items() if there)
