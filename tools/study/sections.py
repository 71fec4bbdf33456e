"""Cross sections of deformed meshes (thesis Figures 6.2 to 6.23)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slideviz.cli import run
from tools.study.cases import CALLS


@dataclass(frozen=True)
class Section:
    """Sections of one case by several methods.

    Attributes
    ----------
    call : str
        Name of the case.
    figures : str
        The thesis's.
    combinations : tuple of (str, str)
        Method and periodic mode.
    where : tuple of str
        Arguments of ``slideviz section``.
    """

    call: str
    figures: str
    combinations: tuple[tuple[str, str], ...]
    where: tuple[str, ...]


SECTIONS = (
    Section(
        "hexahedron-flat",
        "6.2",
        (("none", "none"), ("ps", "none"), ("ds", "none")),
        ("--plane", "z=0.5"),
    ),
    Section(
        "hexahedron",
        "6.4 to 6.10",
        (("none", "none"), ("ps", "none"), ("ds", "none"), ("ps", "fixed"), ("ps", "moving")),
        ("--plane", "z=0.7"),
    ),
    Section(
        "cylindrical",
        "6.13 to 6.17",
        (("none", "fixed"), ("ps", "none"), ("ps", "moving"), ("ds", "moving")),
        ("--plane", "z=0.6"),
    ),
    Section(
        "stator",
        "6.20 to 6.23",
        (("ps", "moving"), ("elastic", "moving")),
        ("--cylinder", "0.2512", "--copies", "1"),
    ),
)

_KEYS = {
    "none": ("SLIDING_MODE=none",),
    "ps": ("SLIDING_MODE=ps",),
    "ds": ("SLIDING_MODE=ds",),
    "elastic": ("METHOD=elastic", "SLIDING_MODE=ds"),
}


def draw_sections(section: Section, output: Path) -> None:
    """Deform the case by each method and write a picture of its section."""
    (call,) = [call for call in CALLS if call.name == section.call]
    folder = output / call.name
    case = folder / f"{call.sample}.cfg"
    steps = call.steps.split(",")[-1]
    for method, periodic in section.combinations:
        mesh = folder / f"{method}_{periodic}.su2"
        keys = (*call.settings, *_KEYS[method], f"PERIODIC_MODE={periodic}", f"STEPS={steps}")
        keys = (*keys, "GENERATE_QUALITY=NO")
        words = [word for text in keys for word in ("--set", text)]
        run(["run", str(case), "-o", str(mesh), "-q", *words])
        picture = folder / f"section_{method}_{periodic}.png"
        argv = ["section", str(mesh), "--reference", str(folder / "mesh.su2")]
        argv += ["--case", str(case), *section.where, "-o", str(picture)]
        metric = [text.split("=")[1] for text in call.settings if text.startswith("QUALITY")]
        run([*argv, *(["--metric", metric[0]] if metric else [])])
        mesh.unlink(missing_ok=True)
