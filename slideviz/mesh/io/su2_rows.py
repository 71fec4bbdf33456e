"""The number lines that belong to a section of an SU2 file, counted."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.io.su2_scan import Lines, show
from slideviz.mesh.io.su2_sections import Section, count_of
from slideviz.mesh.model import IntArray


class Rows:
    """Finds the lines of numbers, and of other text, in each section of a file."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self.data_lines = np.flatnonzero(lines.numeric)
        self.text_lines = np.flatnonzero(~lines.numeric & (lines.words > 0))

    def _numbers(self, section: Section) -> IntArray:
        """Return the numeric lines of a section."""
        i, j = np.searchsorted(self.data_lines, [section.line, section.stop])
        return self.data_lines[i:j]

    def none(self, section: Section) -> None:
        """Do nothing when a section has no numbers, as it should.

        Raises
        ------
        MeshError
            It has some.
        """
        rows = self._numbers(section)
        if len(rows):
            raise self.lines.error(
                int(rows[0]),
                f"numbers stand here after {section.key}= {show(section.value)}, where none "
                "belong; remove the line or restore the keyword before it",
            )

    def counted(self, section: Section, what: str) -> IntArray:
        """Return the lines of numbers of a section, (r,).

        Parameters
        ----------
        what : str
            What stands on each line, for messages.

        Raises
        ------
        MeshError
            They are not as many as the number after the keyword says.
        """
        count = count_of(self.lines, section)
        rows = self._numbers(section)
        texts = self.text_lines[
            np.searchsorted(self.text_lines, section.line, "right") : np.searchsorted(
                self.text_lines, section.stop
            )
        ]
        last = rows[count - 1] if 0 < count <= len(rows) else section.line
        if len(texts) and (len(rows) < count or texts[0] < last):
            word = self.lines.line(int(texts[0])).split()[0]
            raise self.lines.error(
                int(texts[0]),
                f"'{show(word)}' stands where one of the {count} {what} should be ({section.key} "
                f"on line {section.line + 1}); correct it",
            )
        if len(rows) < count:
            raise self.lines.error(
                min(section.stop, len(self.lines) - 1),
                f"only {len(rows)} {what} precede this line, but {section.key}= {count} (line "
                f"{section.line + 1}) says {count}; restore the missing lines or correct the count",
            )
        if len(rows) > count:
            raise self.lines.error(
                int(rows[count]),
                f"more {what} stand here than {section.key}= {count} (line {section.line + 1}) "
                f"says: {len(rows)}; correct the count",
            )
        return rows
