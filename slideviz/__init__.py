"""slideviz: deform CFD meshes with radial basis functions, and measure and preserve their quality.

The public names are loaded when first used, so that ``slideviz --version`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from slideviz.case.limits import Limit, LimitResult, quality
    from slideviz.case.model import Case
    from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
    from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness, FfdTwist
    from slideviz.case.motions.file import FromFile, Prescribed
    from slideviz.case.motions.onto import Onto
    from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
    from slideviz.case.motions.span import SpanMotion
    from slideviz.design.blade_gaps import Gap, gaps
    from slideviz.design.deformed_wheel import WheelQuality, wheel
    from slideviz.design.deformer import Constraint, Deformer
    from slideviz.design.span_variables import SpanVariables
    from slideviz.design.sweeps.sweep import sweep
    from slideviz.errors import ConditionWarning, SlidevizError, ToleranceWarning
    from slideviz.export.flat_section import section
    from slideviz.export.verbs import film, picture
    from slideviz.formats.files import convert, read, write
    from slideviz.mesh.margin import SafeFraction
    from slideviz.mesh.metrics import MetricValues, metrics
    from slideviz.mesh.model import Cells, Marker, Mesh
    from slideviz.mesh.quality import Quality
    from slideviz.mesh.quality_derivative import QualityDerivative
    from slideviz.mesh.walls import Walls, walls
    from slideviz.plots.section_picture import SectionStyle
    from slideviz.rbf.reduction import Reduction
    from slideviz.scene.overview import Detail
    from slideviz.sections.model import Section
    from slideviz.solver.deform import Step, deform
    from slideviz.solver.repair_stage import repair
    from slideviz.solver.safe_fraction import safe_fraction
    from slideviz.solver.steps import MeshRepair
    from slideviz.study.combinations import Combination, compare

_NAMES = {
    "case.limits": "Limit LimitResult quality",
    "case.model": "Case",
    "case.motions.airfoil": "Bump Cst HicksHenne",
    "case.motions.box": "Ffd FfdCamber FfdThickness FfdTwist",
    "case.motions.file": "FromFile Prescribed",
    "case.motions.onto": "Onto",
    "case.motions.rigid": "Radial Rotate Scale Translate",
    "case.motions.span": "SpanMotion",
    "design.blade_gaps": "Gap gaps",
    "design.deformed_wheel": "WheelQuality wheel",
    "design.deformer": "Constraint Deformer",
    "design.span_variables": "SpanVariables",
    "design.sweeps.sweep": "sweep",
    "errors": "ConditionWarning SlidevizError ToleranceWarning",
    "export.flat_section": "section",
    "export.verbs": "film picture",
    "formats.files": "convert read write",
    "mesh.margin": "SafeFraction",
    "mesh.metrics": "MetricValues metrics",
    "mesh.model": "Cells Marker Mesh",
    "mesh.quality": "Quality",
    "mesh.quality_derivative": "QualityDerivative",
    "mesh.walls": "Walls walls",
    "plots.section_picture": "SectionStyle",
    "rbf.reduction": "Reduction",
    "scene.overview": "Detail",
    "sections.model": "Section",
    "solver.deform": "Step deform",
    "solver.repair_stage": "repair",
    "solver.safe_fraction": "safe_fraction",
    "solver.steps": "MeshRepair",
    "study.combinations": "Combination compare",
}  # the public names of each module
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = [
    "Bump", "Case", "Cells", "Combination", "ConditionWarning", "Constraint", "Cst", "Deformer",
    "Detail", "Ffd", "FfdCamber", "FfdThickness", "FfdTwist", "FromFile", "Gap", "HicksHenne",
    "Limit", "LimitResult", "Marker", "Mesh", "MeshRepair", "MetricValues", "Onto", "Prescribed",
    "Quality", "QualityDerivative", "Radial", "Reduction", "Rotate", "SafeFraction", "Scale",
    "Section", "SectionStyle", "SlidevizError", "SpanMotion", "SpanVariables", "Step",
    "ToleranceWarning", "Translate", "Walls", "WheelQuality", "__version__", "compare", "convert",
    "deform", "film",
    "gaps", "metrics", "picture", "quality", "read", "repair", "safe_fraction", "section", "sweep",
    "walls", "wheel", "write",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'slideviz' has no attribute {name!r}")
    value = getattr(import_module(f"slideviz.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
