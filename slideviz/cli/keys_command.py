"""``slideviz keys``: the reference of all case keys."""

from __future__ import annotations

from argparse import Namespace

from slideviz.case.cfg import describe_keys
from slideviz.cli.terminal import DONE


def main(_: Namespace) -> int:
    """Print the reference of all case keys; return the exit code."""
    print(describe_keys())
    return DONE
