"""``python -m tools.study``: runs the cases and writes tables and pictures into study/."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from slideviz.cli import run
from slideviz.formats.files import write
from tools.shots import shrink
from tools.study.cases import CALLS, Call
from tools.study.dense import dense
from tools.study.sections import SECTIONS, draw_sections
from tools.study.summary import write_summary

WIDTH = 1000
"""Pixels; somewhat more than a page shows, so that letters stay sharp."""

FIGURES = {
    "study-quality.png": "square/quality_20_steps.png",  # thesis Figures 5.2, 5.6, 5.9
    "study-steps.png": "square/steps.png",  # 5.1, 5.5, 5.7, 5.8
    "study-convergence.png": "dense/figure_5.21.png",
    "study-span.png": "stator/spanwise_01_steps.png",  # 6.19
}
"""Names of the pictures, and the figures they are made of."""


def main(argv: Sequence[str]) -> int:
    """Run the study; 1 when a call failed."""
    parser = argparse.ArgumentParser(prog="make study", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("study"), metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="small meshes, few steps, no summary")
    parser.add_argument("--only", metavar="LIST", help="names of cases, with commas")
    parser.add_argument(
        "--publish",
        type=Path,
        metavar="DIR",
        help="run nothing; put the main figures of a finished study there",
    )
    arguments = parser.parse_args(argv)
    if arguments.publish:
        for path in publish(arguments.output, arguments.publish):
            _say(str(path))
        return 0
    names = [call.name for call in CALLS] + ["dense"]
    wanted = arguments.only.split(",") if arguments.only else names
    for name in wanted:
        if name not in names:
            parser.error(f"no case {name!r}; there are {', '.join(names)}")
    failed = []
    begin = time.perf_counter()
    for call in CALLS:
        if call.name in wanted and (call.quick_steps or not arguments.quick):
            _say(f"\n== {call.name}: {call.about}")
            if _compare(call, arguments.output, arguments.quick):
                failed.append(call.name)
    for section in SECTIONS:
        if section.call in wanted and not arguments.quick:
            draw_sections(section, arguments.output)
    if "dense" in wanted:
        _say("\n== dense: Figures 5.19 to 5.23")
        dense(arguments.output / "dense", 60 if arguments.quick else 200)
    if not arguments.quick:  # what is published is of the full cases
        for path in write_summary(arguments.output):
            _say(str(path))
    _say(f"{time.perf_counter() - begin:.0f} s")
    if failed:
        _say(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


def _compare(call: Call, output: Path, quick: bool) -> int:
    """Write the sample and compare; return the exit code."""
    folder = output / call.name
    size = call.quick_size if quick else call.size
    options = ["--variant", call.variant] if call.variant else []
    options += [] if call.mesh else ["--size", str(size)]
    code = run(["sample", call.sample, "-o", str(folder), "--force", *options])
    if code:
        return code
    if call.mesh:
        write(folder / "mesh.su2", call.mesh(size), True)
    argv = ["compare", str(folder / f"{call.sample}.cfg"), "-o", str(folder)]
    argv += ["--methods", call.methods, "--steps", call.quick_steps if quick else call.steps]
    argv += ["--periodic", call.periodic]
    argv += [] if call.pictures else ["--no-pictures"]
    argv += [word for text in call.settings for word in ("--set", text)]
    return run(argv)


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def publish(output: Path, folder: Path) -> list[Path]:
    """Write the main figures of a finished study into a folder, and return them."""
    from PIL import Image

    made = []
    for name, figure in FIGURES.items():
        with Image.open(output / figure) as image:
            drawn = image.convert("RGB")
        width = min(WIDTH, drawn.width)
        size = width, round(drawn.height * width / drawn.width)
        made.append(folder / name)
        drawn.resize(size, Image.Resampling.LANCZOS).save(made[-1])
        shrink(made[-1])
    return made


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
