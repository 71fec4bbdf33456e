"""What the study runs: samples, settings, and combinations for each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from slideviz.mesh.model import Mesh
from tools.study.vane_mesh import row_mesh

GREEDY_3D = (
    "DATA_REDUCTION=YES",
    "DATA_RED_TOLERANCE=0.001",
    "SELECTION=double",
    "QUALITY_METRIC=rbf-slide",
)
"""As in thesis sections 6.2 and 6.3; the metric is that of its program (see README)."""

EXACT_3D = ("DATA_REDUCTION=NO", "QUALITY_METRIC=rbf-slide")
RBF = "none,ps,ds"


@dataclass(frozen=True)
class Call:
    """One call of ``slideviz compare``.

    Attributes
    ----------
    name : str
        Of its folder.
    sample, variant : str
    size : int
        Of the sample, or of ``mesh``.
    quick_size : int
        Of the sample, or of ``mesh``, for ``--quick``.
    methods, periodic, steps : str
        Lists, as ``compare`` takes them.
    quick_steps : str
        Steps for ``--quick``; empty: the call is left out there.
    settings : tuple of str
        KEY=VALUE.
    about : str
        Where the thesis shows it.
    """

    name: str
    sample: str
    about: str
    size: int = 25
    quick_size: int = 25
    variant: str = ""
    methods: str = RBF
    periodic: str = "none,periodic,fixed,moving"
    steps: str = "1,2,5,10,20"
    quick_steps: str = "1,5"
    settings: tuple[str, ...] = ()
    pictures: bool = True
    """Whether there are quality pictures."""
    mesh: Callable[[int], Mesh] | None = None
    """Makes a mesh of a size that the sample does not have."""


CALLS = (
    Call("square", "square", "Figures 5.1, 5.2 and 5.5 to 5.11"),
    Call(
        "square-robust",
        "square",
        "Figures 5.3 and 5.4",
        variant="translate",
        periodic="none",
        steps="1,5,20",
    ),
    Call("polar", "polar", "Figures 5.12 to 5.18"),
    Call(
        "turbine-row",
        "turbine-row",
        "Figures 5.24 to 5.32; tolerance 0.01 % of the chord",
        size=224_180,
        quick_size=20_000,
        mesh=row_mesh,
        steps="1,2,5,10",
        quick_steps="1,2",
        settings=("DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=4e-6"),
    ),
    Call(
        "turbine-row-methods",
        "turbine-row",
        "Table 6.1's comparison on the turbine row",
        size=224_180,
        quick_size=20_000,
        mesh=row_mesh,
        methods="ps,ds,idw,elastic",
        periodic="moving",
        steps="1,2",
        quick_steps="1",
        settings=("DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=1e-6"),
    ),
    Call(
        "hexahedron",
        "hexahedron",
        "Figures 6.3 to 6.11; greedy, tolerance 0.001",
        quick_size=15,
        steps="1,2,5,10,20",
        settings=GREEDY_3D,
    ),
    Call(
        "hexahedron-exact",
        "hexahedron",
        "the same with all control nodes",
        steps="20",
        quick_steps="",
        settings=EXACT_3D,
        pictures=False,
    ),
    Call(
        "hexahedron-flat",
        "hexahedron",
        "Figures 6.1 and 6.2",
        variant="flat",
        quick_size=15,
        periodic="none",
        steps="20",
        quick_steps="5",
        settings=GREEDY_3D,
    ),
    Call(
        "cylindrical",
        "cylindrical",
        "Figures 6.12 to 6.18; greedy, tolerance 0.001",
        quick_size=15,
        steps="1,2,5,10,20",
        settings=GREEDY_3D,
    ),
    Call(
        "cylindrical-exact",
        "cylindrical",
        "the same with all control nodes",
        steps="20",
        quick_steps="",
        settings=EXACT_3D,
        pictures=False,
    ),
    Call(
        "stator",
        "stator",
        "Table 6.1, Figures 6.19 and 6.20; tolerance 0.1 % of the chord",
        size=240_000,
        quick_size=12_000,
        methods="ps,ds,idw,elastic",
        periodic="moving",
        steps="1",
        quick_steps="1",
        settings=("DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=4.5e-5"),
    ),
)


@dataclass(frozen=True)
class Greedy:
    """A greedy selection on the dense square, to 1e-6, in one step.

    Attributes
    ----------
    figure : str
        The thesis's figure it is a line of.
    label : str
    method : str
    settings : tuple of str
    """

    figure: str
    label: str
    method: str
    settings: tuple[str, ...]


def _sized(size: int) -> tuple[str, ...]:
    return ("MULTILEVEL=YES", "MULTI_CRIT=size", f"LVL_SIZE={size}")


def _ratio(part: float) -> tuple[str, ...]:
    return ("MULTILEVEL=YES", "MULTI_CRIT=tol", f"LVL_TOL_CRIT={part}")


_DOUBLE, _ONE = ("SELECTION=double",), ("SELECTION=one",)
_SIZES, _RATIOS = (32, 64, 128, 256), (0.1, 0.25, 0.5)

GREEDY = (
    *(
        Greedy("5.19", f"{label}, {edges}", "none", (*level, *pick))
        for label, level in (
            ("single level", ("MULTILEVEL=NO",)),
            *((f"levels of {size}", _sized(size)) for size in (32, 64, 128)),
        )
        for edges, pick in (("one node", _ONE), ("double-edged", _DOUBLE))
    ),
    *(
        Greedy(figure, label, method, (*level, *pick))
        for figure, method, kind in (
            ("5.20", "none", "size"),
            ("5.21", "none", "ratio"),
            ("5.22-ps", "ps", "size"),
            ("5.22-ds", "ds", "size"),
            ("5.23-ps", "ps", "ratio"),
            ("5.23-ds", "ds", "ratio"),
        )
        for label, level, pick in (
            ("single level", ("MULTILEVEL=NO",), _DOUBLE),
            *(
                ((f"levels of {size}", _sized(size), _DOUBLE) for size in _SIZES)
                if kind == "size"
                else ((f"levels of ratio {part}", _ratio(part), _DOUBLE) for part in _RATIOS)
            ),
            ("single level, blocks", ("MULTILEVEL=NO",), ("SELECTION=block",)),
        )
    ),
)
"""The lines of Figures 5.19 to 5.23, and slideviz's selection in blocks beside them."""
