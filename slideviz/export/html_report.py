"""A report of runs as one HTML file: picture, histogram, tables, settings and versions.

Nothing in it comes from a network.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
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
from slideviz.session.run_messages import remarks_of
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
td {{ border-bottom: 1px solid #ccc; padding: 2px 1em 2px 0; vertical-align: top }}
</style>
<h1>{0}</h1>"""


def write_html_report(path: Path, renderer: OffscreenRenderer) -> None:
    """Write a report of the session of a renderer, which draws its picture.

    Raises SlidevizError if the file cannot be written.
    """
    session = renderer.session
    mesh = session.mesh
    assert mesh is not None
    case = shown_case(session)
    runs = [run for run in session.runs if run.frames]
    shown = [run for run in runs if run.number == session.shown]
    options = PictureOptions(title=True, fill=renderer.fills).like(session.view)
    figure = empty_figure((8.0, 3.5), 150.0, "constrained")
    draw_histogram(session, figure, PRINT, log=True, full_range=True)
    pictures = png_bytes(renderer.image(options)), figure_bytes(figure, "png", 150.0)
    walls = [(row.name, *row.after) for row in wall_rows(session)]
    tables: dict[str, list[Iterable[str]]] = {
        "Runs": [(column.title, *map(column.text, runs)) for column in COLUMNS if runs],
        "Limits": [
            (str(result.limit), result.value_words, "met" if result.passed else "not met")
            for run in shown
            for result in run.frames[-1].limits
        ],
        "Layers at walls": [WALL_COLUMNS, *walls] if walls else [],
        "Warnings": [(text,) for run in shown for text in remarks_of(run, "warning")],
        "Case": [
            (key.name, key.kind.write(value))
            for key in KEYS.values()
            if (value := key.get(case)) is not None
        ],
        "Versions": [(line,) for line in versions().splitlines()],
    }
    parts = [_HEAD.format(escape((session.case.source or Path(mesh.name)).name))]
    parts.append(f"<p>{escape(mesh_words(mesh)[0])}</p>")
    encoded = (b64encode(picture).decode() for picture in pictures)
    parts += (f'<img alt="" src="data:image/png;base64,{picture}">' for picture in encoded)
    for title, rows in tables.items():
        if rows:
            lines = (f"<tr><td>{'<td>'.join(map(escape, row))}</tr>" for row in rows)
            parts.append("\n".join([f"<h2>{title}</h2><table>", *lines, "</table>"]))
    write_whole(path, "\n".join(parts))
