"""Write the manual page slideviz(1) to a file, from the tables of commands: ``man.py FILE``."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from slideviz import __version__
from slideviz.cli.commands import COMMANDS
from slideviz.cli.completion_command import Option, options

INTRODUCTION = """\
.SH NAME
slideviz \\- deform CFD meshes with radial basis functions
.SH SYNOPSIS
.B slideviz
.RI [ FILE ]
.br
.B slideviz
.I COMMAND
.RI [ ARGUMENTS ]
.SH DESCRIPTION
Without a command, the window opens, with a mesh, a case (.cfg) or a session (.slideviz). The
commands do not need a screen.
.SH COMMANDS
"""

REMAINDER = """\
.SH EXIT STATUS
.TP
.B 0
done
.TP
.B 1
the mesh or the case is wrong
.TP
.B 2
wrong usage
.TP
.B 3
done, but cells are inverted
.TP
.B 4
done, but a limit of the case is not met
.TP
.B 130
cancelled
.TP
.B 143
ended by SIGTERM
.SH ENVIRONMENT
.TP
.BR NUMBA_NUM_THREADS ", " OPENBLAS_NUM_THREADS
limit the threads of compiled loops and of linear algebra
.SH EXAMPLES
.nf
slideviz sample passage -o try
slideviz run try/passage.cfg -o moved.su2 --picture quality.png
slideviz try/passage.cfg
.fi
"""


def escaped(text: str) -> str:
    """Return a text whose signs groff would read otherwise, written for it."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("`", "\\(ga")
    return f"\\&{text}" if text.startswith(".") else text


def entry(option: Option) -> str:
    """Return an argument with its values and its help, as a paragraph with a hanging tag."""
    value = f" \\fI{escaped(option.takes)}\\fR" if option.flags and option.takes else ""
    tag = ", ".join(f"\\fB{escaped(flag)}\\fR{value}" for flag in option.flags)
    values = ", ".join(option.values) if 1 < len(option.values) <= 12 else ""
    words = f"{option.words}; one of {values}" if values else option.words
    tag = tag or f"\\fI{escaped(option.takes)}\\fR"
    return f".TP\n{tag}\n{escaped(words)}\n"


def page() -> str:
    """Return the manual page in groff's language."""
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", time.time()))
    day = time.strftime("%Y-%m-%d", time.gmtime(seconds))
    text = f'.TH SLIDEVIZ 1 "{day}" "slideviz {__version__}" "User Commands"\n{INTRODUCTION}'
    for name, some in options().items():
        row = COMMANDS[name]
        text += f".SS {name}\n{escaped(row.description or row.help)}\n"
        text += "".join(entry(option) for option in some if "--help" not in option.flags)
    return text + REMAINDER


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
