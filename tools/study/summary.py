"""The published numbers beside those of the study, as a table in Markdown and as CSV."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from slideviz.mesh.quality import quality

HERE = Path(__file__).parent
NOTABLE = 0.02
INVERTED = "inverted"

Key = tuple[str, str, str, str, str]
Table = Mapping[Key, str]


@dataclass(frozen=True)
class Line:
    """A published number, and what the study gives.

    Attributes
    ----------
    key : tuple of str
        Case, method, periodic mode, number of steps, and what the number is.
    thesis, rbf_slide, ours, exact : str
        Numbers as text, ``inverted``, or nothing; ``exact`` is ours with all control nodes.
    source : str
        Place in the thesis.
    other_mesh : bool
        The thesis's mesh is not public, ours stands in for it: nothing to compare digit by digit.
    """

    key: Key
    thesis: str
    rbf_slide: str
    ours: str
    exact: str
    source: str
    other_mesh: bool

    def differences(self) -> tuple[float | None, float | None]:
        """Return by how much ours differs from the thesis and its program, as parts of theirs."""
        return _difference(self.ours, self.thesis), _difference(self.ours, self.rbf_slide)

    def notable(self) -> bool:
        """Return whether a number on the same mesh differs by more than 2 %."""
        found = self.differences()
        return not self.other_mesh and any(d is None or abs(d) > NOTABLE for d in found)


def _difference(ours: str, theirs: str) -> float | None:
    """Return the difference as a part of theirs; None when only one has a valid mesh."""
    if not theirs or not ours or ours == theirs:
        return 0.0
    if INVERTED in (ours, theirs):
        return None
    return float(ours) / float(theirs) - 1.0


def write_summary(output: Path) -> list[Path]:
    """Write ``summary.csv`` and ``summary.md`` from what is in the folder; return them."""
    found = _read(output)
    lines = []
    with (HERE / "published.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = (row["case"], row["method"], row["periodic"], row["steps"], row["value"])
            if key in found:
                exact = found.get((f"{key[0]}-exact", *key[1:]), "")
                numbers = row["thesis"], row["rbf_slide"], found[key], exact
                lines.append(Line(key, *numbers, row["source"], row["mesh"] != ""))
    table = output / "summary.csv"
    with table.open("w", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            [
                "case",
                "method",
                "periodic",
                "steps",
                "value",
                "thesis",
                "source",
                "rbf_slide",
                "slideviz",
                "exact",
            ]
        )
        for line in lines:
            numbers = line.thesis, line.source, line.rbf_slide, line.ours, line.exact
            writer.writerow([*line.key, *numbers])
    text = output / "summary.md"
    text.write_text(_markdown(lines), encoding="utf-8")
    return [table, text]


def _read(output: Path) -> dict[Key, str]:
    """Return all numbers of the study, by case, method, mode, steps and value."""
    found: dict[Key, str] = {}
    for path in sorted(output.glob("*/compare.csv")):
        with path.open(encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if row["problem"]:
                    continue
                begin = path.parent.name, row["method"], row["periodic"], row["steps"]
                bad = row["inverted"] != "0"
                found[*begin, "min"] = INVERTED if bad else row["min"]
                found[*begin, "mean"] = row["mean"]
    nodes = output / "dense" / "nodes.csv"
    if nodes.exists():
        with nodes.open(encoding="utf-8") as file:
            for row in csv.DictReader(file):
                value = f"nodes {row['selection']} {float(row['tolerance']):g}"
                found["dense", row["method"], "none", "1", value] = row["control_nodes"]
    return found | _undeformed(output)


def _undeformed(output: Path) -> dict[Key, str]:
    from slideviz import read

    found: dict[Key, str] = {}
    for case in ("polar", "turbine-row", "stator"):
        path = output / case / "mesh.su2"
        if path.exists():
            before = quality(read(path))
            found[case, "undeformed", "", "0", "min"] = repr(before.min)
            found[case, "undeformed", "", "0", "mean"] = repr(before.mean)
    return found


def _markdown(lines: list[Line]) -> str:
    head = ["case", "method", "periodic", "value", "thesis", "RBF-SliDe", "slideviz", "exact", ""]
    rows = ["| " + " | ".join(head) + " |", "| " + " | ".join(["---"] * len(head)) + " |"]
    for line in lines:
        case, method, periodic, _, value = line.key
        mark = "other mesh" if line.other_mesh else ("differs" if line.notable() else "")
        numbers = [_short(text) for text in (line.thesis, line.rbf_slide, line.ours, line.exact)]
        rows.append("| " + " | ".join([case, method, periodic, value, *numbers, mark]) + " |")
    return "\n".join(rows) + "\n"


def _short(text: str) -> str:
    if not text or text == INVERTED or "." not in text:
        return text
    return f"{float(text):.6g}"
