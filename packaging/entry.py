"""The program of the folder that PyInstaller makes: ``slideviz``, without an installed Python.

`sys.executable` is this program there. So it also does what slideviz and multiprocessing start
Python for: `slideviz.formats.files` reads a file of a foreign format in a process of its own by
``-P -c CODE``, and sweeps have worker processes.
"""

from __future__ import annotations

import multiprocessing
import sys

from slideviz.__main__ import main

if __name__ == "__main__":
    multiprocessing.freeze_support()
    if sys.argv[1:3] == ["-P", "-c"]:
        code = sys.argv[3]
        del sys.argv[1:4]
        exec(code)
        sys.exit()
    sys.exit(main())
