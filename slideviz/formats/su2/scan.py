"""Finding the lines of an SU2 file, block by block on all cores."""

from __future__ import annotations

import numpy as np

from slideviz.errors import MeshError, printable
from slideviz.formats.source import Source
from slideviz.formats.su2.lines import Lines, line_end, text_of
from slideviz.mesh.model import IntArray
from slideviz.system.threads import Tick, ordered_map

BLOCK_BYTES = 1 << 20
"""About how many bytes a block has: whole lines that are scanned together."""


def scan(raw: Source, progress: Tick) -> Lines:
    """Return the lines of an SU2 file.

    Parameters
    ----------
    raw : Source
        The file.
    progress : callable
        Called with the fraction done after each block; may raise to stop.

    Raises
    ------
    MeshError
        The file is empty or not text.
    """
    from slideviz.formats.su2.loops import RUN_COLUMNS, scan_block

    def scanned(bounds: tuple[int, int]) -> tuple[IntArray, int, bool]:
        text = text_of(raw, *bounds)
        if b"\0" in text:
            raise MeshError(
                f"{printable(raw.path)}: this is not a text file; write the mesh as ASCII, or "
                "name SU2's binary form (ending .su2b, or MESH_FORMAT= SU2B)"
            )
        runs = np.empty((text.count(b"\n"), RUN_COLUMNS), np.int64)
        n_runs, n_lines = scan_block(np.frombuffer(text, np.uint8), runs)
        runs[:n_runs, 0] += bounds[0]
        return runs[:n_runs].copy(), n_lines, text.isspace()

    found, line, blank = [], 0, True
    blocks = _blocks(raw)
    for (_, end), (runs, n_lines, empty) in zip(blocks, ordered_map(scanned, blocks), strict=True):
        runs[:, 1] += line
        found.append(runs)
        line += n_lines
        blank &= empty
        progress(end / raw.size)
    if blank:
        raise MeshError(f"{printable(raw.path)}: the file is empty; write the mesh again")
    begins, firsts, kinds, rows, nodes = np.concatenate(found).T.copy()
    return Lines(raw, np.append(begins, raw.size), np.append(firsts, line), kinds, rows, nodes)


def _blocks(raw: Source) -> list[tuple[int, int]]:
    """Return first byte and end of the blocks of a file, whole lines each."""
    bounds, begin = [], 0
    while begin < raw.size:
        end = line_end(raw, min(begin + BLOCK_BYTES, raw.size) - 1)
        bounds.append((begin, end))
        begin = end
    return bounds
