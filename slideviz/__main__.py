"""Entry point: ``slideviz`` and ``python -m slideviz``."""

from __future__ import annotations

import sys


def main() -> int:
    """Run the command line and return its exit code; ``--version`` loads nothing heavy."""
    if sys.argv[1:] in (["--version"], ["-V"]):
        from slideviz import __version__

        print(f"slideviz {__version__}")
        return 0
    try:
        from slideviz.cli import run

        return run(sys.argv[1:])
    except KeyboardInterrupt:  # before `run` could catch it
        return 130


if __name__ == "__main__":
    sys.exit(main())
