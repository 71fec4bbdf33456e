"""Loaded by each Python process that has this folder in its path; see ``rules.py``."""

import os
import runpy
import sys

if os.environ.get("SLIDEVIZ_TESTS") == "portable" and "slideviz-portable" not in sys.modules:
    file = os.path.join(os.path.dirname(__file__), "rules.py")  # noqa: PTH118, PTH120
    sys.modules["slideviz-portable"] = sys
    runpy.run_path(file)["install"]()
