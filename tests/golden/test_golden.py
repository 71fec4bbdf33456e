"""What users get is what was recorded: `make golden` records it anew, where it is to change."""

from __future__ import annotations

import shutil
import sys

import pytest

from tests.golden.parts import PARTS, QUICK
from tests.golden.record import KEPT, NEW, changes, produce

SLOW = [pytest.param(part, marks=pytest.mark.slow) for part in PARTS if part not in QUICK]


@pytest.mark.timeout(600)
@pytest.mark.parametrize("part", [*QUICK, *SLOW])
def test_users_get_what_was_recorded(part, tmp_path):
    if part == "texts" and sys.version_info >= (3, 13):
        pytest.skip("argparse words its help in another way since Python 3.13")
    if part == "window" and not shutil.which("Xvfb"):
        pytest.skip("needs Xvfb")
    made, place = tmp_path / "made", tmp_path / "place"
    place.mkdir()
    produce(part, made, place)
    found = changes(KEPT / part, made)
    if "font.txt" in found:  # the machine's: pictures of the window have its letters
        found = {name: words for name, words in found.items() if name.endswith(".txt")}
        del found["font.txt"]
    beside = NEW / part
    shutil.rmtree(beside, ignore_errors=True)
    for name in found:
        if (made / name).exists():
            beside.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(made / name, beside / name)
    told = "\n".join(f"{name}\n{words}" for name, words in found.items())
    assert not found, f"{told}\n(what is new is in {beside}; `make golden` records it)"
