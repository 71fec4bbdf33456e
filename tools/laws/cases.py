"""A random case for a random mesh: mostly what somebody could mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slideviz.case.model import Case
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.rbf.kernels import PLAIN
from slideviz.rbf.reduction import Reduction
from slideviz.terms import KERNELS, SLIDING, Role
from tools.laws.draw import Made, Period, Rng
from tools.laws.meshes import nearest_neighbour, random_mesh


@dataclass(frozen=True, eq=False)
class Run:
    """A mesh and a case, and the period that the case has, if any."""

    seed: int
    made: Made
    case: Case
    period: Period | None

    @property
    def mesh(self) -> Mesh:
        """Return the undeformed mesh."""
        return self.made.mesh


def random_run(seed: int) -> Run:
    """Return the run of a seed: the same one everywhere."""
    rng = np.random.default_rng([seed, 20])
    made = random_mesh(rng)
    moving = _moving(rng, made)
    period = _period(rng, made, moving)
    roles = _roles(rng, made, moving, period)
    settings = _method(rng, period) | _radial(rng) | {"steps": _steps(rng)}
    if rng.random() < 0.4:
        settings["reduction"] = _reduction(rng, made.mesh.extent)
    settings["curved"] = bool(rng.random() < 0.3)
    if rng.random() < 0.1:
        settings["feature_angle_deg"] = float(rng.uniform(10, 80))
    motions = _motions(rng, made.mesh, moving, period)
    if rng.random() < 0.2:
        thickness = float(rng.uniform(0.02, 0.3)) * made.mesh.extent
        if settings["method"] == "rbf":  # other methods are refused with them
            settings |= {"layers": "keep", "layer_thickness": thickness}
    case = Case(roles=roles, motions=motions, **settings)
    return Run(seed, made, case, period)


def _moving(rng: Rng, made: Made) -> tuple[str, ...]:
    """Return the markers that move: mostly all of a body, sometimes any one."""
    if rng.random() < 0.1:
        return (str(rng.choice(made.mesh.marker_names)),)
    first = rng.random() < 0.75
    body = made.bodies[0 if first else int(rng.integers(len(made.bodies)))]
    return body if rng.random() < 0.85 else body[:1]


def _period(rng: Rng, made: Made, moving: tuple[str, ...]) -> Period | None:
    """Return how the case repeats, None where it does not."""
    possible = [
        period
        for period in made.periods
        if period.sides and not {name for side in period.sides for name in side} & set(moving)
    ]
    if not possible or rng.random() < 0.3:
        return None
    period = possible[int(rng.integers(len(possible)))]
    if len(period.sides) > 1 and rng.random() < 0.2:
        # One half repeats, the other is a wall.
        return replace(period, sides=period.sides[:1])
    return period


def _roles(rng: Rng, made: Made, moving: tuple[str, ...], period: Period | None) -> dict[str, Role]:
    """Return the role of each marker; some are left out, which makes them fixed."""
    style = rng.choice(["slide", "mixed"])
    chances = [0.8, 0.1, 0.1] if style == "slide" else [0.4, 0.4, 0.2]
    roles: dict[str, Role] = {}
    for name in made.mesh.marker_names:
        role = str(rng.choice(["sliding", "fixed", "internal"], p=chances))
        if role != "fixed" or rng.random() < 0.5:
            roles[name] = role  # type: ignore[assignment]
    for names in period.sides if period else ():
        for name in rng.permutation(names):
            roles.pop(str(name), None)
            roles[str(name)] = "periodic"
    return roles | dict.fromkeys(moving, "moving")


def _method(rng: Rng, period: Period | None) -> dict[str, Any]:
    others = len(SLIDING) - 1
    sliding = str(rng.choice([*SLIDING], p=[0.2, *[0.8 / others] * others]))
    out: dict[str, Any] = {
        "method": str(rng.choice(["rbf", "idw", "elastic"], p=[0.84, 0.08, 0.08])),
        "sliding": sliding,
    }
    if period is None:
        return out
    modes = ["none", "periodic", "fixed", "moving"][: 3 if sliding == "none" else 4]
    kind = "rotational" if period.angle_deg else "translational"
    out["periodic"] = str(rng.choice(modes))
    out["periodic_type"] = kind if period.angle_deg or rng.random() < 0.5 else "auto"
    if period.angle_deg:
        out |= {"axis": period.axis, "origin": period.origin}
    return out


def _radial(rng: Rng) -> dict[str, Any]:
    kernel = PLAIN if rng.random() < 0.5 else str(rng.choice(list(KERNELS)))
    out: dict[str, Any] = {"kernel": kernel}
    if rng.random() < 0.3:
        high = 10.0 if KERNELS[kernel].compact else 1.0
        out["influence_factor"] = float(np.exp(rng.uniform(np.log(0.3), np.log(high))))
    elif not KERNELS[kernel].compact:
        out["influence_factor"] = 0.5
    if rng.spawn(1)[0].random() < 0.25 and not KERNELS[kernel].polynomial:
        out["polynomial"] = "yes"
    return out


def _steps(rng: Rng) -> int:
    return int(rng.choice([0, 1, 2, 3, 5], p=[0.1, 0.4, 0.2, 0.2, 0.1]))


def _reduction(rng: Rng, extent: float) -> Reduction:
    tolerance = float(10.0 ** rng.uniform(-6, -2))
    relative = rng.random() < 0.5
    return Reduction(
        tolerance=1e-3 if relative else tolerance * extent,
        relative=tolerance if relative else None,
        multilevel=bool(rng.random() < 0.35),
        criterion=str(rng.choice(["size", "tol"])),  # type: ignore[arg-type]
        level_tolerance=float(rng.uniform(0.05, 0.9)),
        level_size=int(rng.integers(4, 65)),
        selection=str(rng.choice(["block", "double", "one"])),  # type: ignore[arg-type]
        max_nodes=int(rng.integers(5, 200)) if rng.random() < 0.15 else None,
        gamma=float(rng.choice([5.0, 25.0, 100.0])),
    )


def _motions(
    rng: Rng, mesh: Mesh, moving: tuple[str, ...], period: Period | None
) -> tuple[Motion, ...]:
    nodes = np.unique(np.concatenate([mesh.marker(name).nodes for name in moving]))
    points = mesh.points[nodes]
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    cell = float(np.median(nearest_neighbour(mesh)[nodes]))
    middle = tuple(points.mean(axis=0).tolist())
    out: list[Motion] = []
    for _ in range(2 if rng.random() < 0.25 else 1):
        # From tiny to about two cells.
        far = cell * 10.0 ** (rng.uniform(-6, 0) if rng.random() < 0.3 else rng.uniform(-2, 0.3))
        one = _motion(rng, (mesh.dim, far, size), middle, period)
        out += [_for(one, name, alone=len(moving) == 1 and rng.random() < 0.5) for name in moving]
    return tuple(out)


def _motion(
    rng: Rng, sizes: tuple[int, float, float], middle: tuple[float, ...], period: Period | None
) -> Motion:
    """Return a motion that displaces by about ``far``."""
    dim, far, size = sizes
    kind = rng.choice(["translate", "rotate", "scale", "radial"], p=[0.45, 0.3, 0.15, 0.1])
    about_axis = period is not None and period.angle_deg and rng.random() < 0.5
    axis, point = (0.0, 0.0, 1.0), middle
    if about_axis and period is not None:
        axis, point = period.axis, period.origin[:dim]
    elif dim == 3:
        axis = tuple(rng.normal(size=3).tolist())
    part = far / size
    if kind == "rotate":
        angle = float(np.degrees(min(part, 1.0)) * rng.choice([-1, 1]))
        return Rotate("", angle, point, axis)
    if kind == "scale":
        return Scale(
            "", tuple((1 + min(part, 0.5) * rng.uniform(-1, 1, rng.choice([1, dim]))).tolist())
        )
    if kind == "radial":
        return Radial("", 1.0 + float(rng.uniform(-0.5, 0.5) * min(part, 0.5)), 0.0, axis, point)
    vector: FloatArray = rng.normal(size=dim)
    if rng.random() < 0.2:
        vector[int(rng.integers(dim))] = 0.0
    return Translate("", tuple((far * vector / np.linalg.norm(vector)).tolist()))


def _for(motion: Motion, marker: str, alone: bool) -> Motion:
    """Return the motion for a marker; about its own centroid where that is the same."""
    if alone and isinstance(motion, Rotate):
        return replace(motion, marker=marker, point="centroid")
    return replace(motion, marker=marker)
