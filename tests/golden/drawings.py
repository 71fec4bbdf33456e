"""What is in a drawing: facts about SVG and PDF files that another computer draws alike."""

from __future__ import annotations

import re
import zlib
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree as ET

_OPERATORS = {"m": "paths begun", "Do": "images or groups", "Tj": "texts", "TJ": "texts"}


def facts(path: Path) -> list[str]:
    """Return the size of a drawing, how many shapes it has and of which colors, and its texts."""
    return _svg(path.read_text("utf-8")) if path.suffix == ".svg" else _pdf(path.read_bytes())


def _svg(text: str) -> list[str]:
    root = ET.fromstring(text)
    kinds = Counter(node.tag.rpartition("}")[2] for node in root.iter())
    colors = Counter(re.findall(r"#[0-9a-f]{6}\b", text))
    # Letters are drawn; what they say stands beside them.
    said = [note.strip() for note in re.findall(r"<!--(.*?)-->", text, re.DOTALL)]
    said += ["".join(node.itertext()) for node in root.iter() if node.tag.endswith("}text")]
    return [
        f"width {root.get('width')}, height {root.get('height')}, box {root.get('viewBox')}",
        *(f"{count} {kind}" for kind, count in sorted(kinds.items()) if kind != "date"),
        f"{len(colors)} colors: " + ", ".join(name for name, _ in colors.most_common(6)),
        *(f"text {words}" for words in said),
    ]


def _pdf(data: bytes) -> list[str]:
    streams = []
    for found in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL):
        try:
            streams.append(zlib.decompress(found[1]).decode("latin-1"))
        except zlib.error:
            continue  # an image, or a font
    drawn = Counter(word for text in streams for word in text.split())
    boxes = re.findall(rb"/MediaBox \[([^]]*)\]", data)
    return [
        *(f"page of {box.decode().strip()}" for box in boxes),
        *(f"{drawn[sign]} {what} ({sign})" for sign, what in _OPERATORS.items()),
    ]
