"""A report of runs as one HTML file: picture, histogram, tables, settings and versions.

Nothing in it comes from a network.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from datetime import datetime
from html import escape
from pathlib import Path

from slideviz.case.keys import KEYS
from slideviz.case.motion_words import mesh_words
from slideviz.export.offscreen import png_bytes
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.plots.figure_io import empty_figure, figure_bytes
from slideviz.plots.session_plots import draw_histogram
from slideviz.plots.style import PRINT
from slideviz.session.motions import shown_case
from slideviz.session.run_messages import end_parts, remarks_of
from slideviz.session.runs_words import COLUMNS
from slideviz.session.walls_table import COLUMNS as WALL_COLUMNS
from slideviz.session.walls_table import wall_rows
from slideviz.system.atomic import write_whole
from slideviz.system.versions import versions

_HEAD = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{0}</title>
<style>
body {{ font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em }}
img {{ max-width: 100% }}
table {{ border-collapse: collapse }}
th, td {{ border-bottom: 1px solid #ccc; padding: 2px 1.5em 2px 0; text-align: left }}
th, td {{ vertical-align: top; white-space: pre-line }}
thead {{ border-bottom: 2px solid #888 }}
tr {{ break-inside: avoid }}
</style>
<h1>{0}</h1>"""
_UNITS = (
    "Lengths are in the unit of the mesh, angles in degrees. Qualities are from 0, of a flat or "
    "inverted cell, to 1, the best. Keys that are not listed have their defaults."
)


def write_html_report(path: Path, renderer: OffscreenRenderer) -> None:
    """Write a report of the session of a renderer, which draws its picture.

    Raises SlidevizError if the file cannot be written.
    """
    session = renderer.session
    mesh = session.opened_mesh
    case = shown_case(session)
    runs = [run for run in session.runs if run.frames]
    shown = [run for run in runs if run.number == session.shown]
    options = PictureOptions(title=True, fill=renderer.fills).like(session.view)
    figure = empty_figure((8.0, 3.5), 150.0, "constrained")
    draw_histogram(session, figure, PRINT, log=True, full_range=True)
    pictures = {
        "The mesh, colored": png_bytes(renderer.image(options)),
        "Histogram of the cells": figure_bytes(figure, "png", 150.0),
    }
    tables: dict[str, list[Sequence[str]]] = {
        "Runs": [
            row
            for column in COLUMNS
            if set((row := (column.title, *map(column.text, runs)))[1:]) - {"–"}
        ],
        "Limits": [
            ("Limit", "Value", "Result"),
            *(
                (str(result.limit), result.value_words, "met" if result.passed else "not met")
                for run in shown
                for result in run.frames[-1].limits
            ),
        ],
        "Layers at walls": [
            WALL_COLUMNS,
            *((row.name, *row.after) for row in wall_rows(session)),
        ],
        "Remarks": [
            ("Run", "Kind", "Remark"),
            *(
                (str(run.number), level, text)
                for run in runs
                for level in ("warning", "note")
                for text in remarks_of(run, level)
            ),
        ],
        "Case": [
            ("Key", "Value"),
            *(
                (key.name, key.kind.write(value).replace("\\\n", "\n"))
                for key in KEYS.values()
                if (value := key.get(case)) is not None and not key.is_default(value)
            ),
        ],
        "Versions": [
            ("Programs and platform",),
            *((line,) for line in versions().splitlines()),
        ],
    }
    parts = [_HEAD.format(escape((session.case.source or Path(mesh.name)).name))]
    said = [
        f"{datetime.now().astimezone():%Y-%m-%d %H:%M %Z}",
        f"{mesh.name}: {mesh_words(mesh)[0].replace('   ', ', ')}.",
        *(f"Run {run.number}: {''.join(end_parts(run))}" for run in runs),
        _UNITS,
    ]
    parts += (f"<p>{escape(words)}</p>" for words in said)
    for about, picture in pictures.items():
        encoded = b64encode(picture).decode()
        parts.append(f'<img alt="{about}" src="data:image/png;base64,{encoded}">')
    for title, rows in tables.items():
        if len(rows) > 1:
            parts += f"<h2>{title}</h2><table><thead>", _row("th", rows[0]), "</thead>"
            parts += (_row("td", row) for row in rows[1:])
            parts.append("</table>")
    write_whole(path, "\n".join(parts))


def _row(tag: str, row: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(text)}</{tag}>' for text in row)}</tr>"
