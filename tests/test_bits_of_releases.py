"""Runs give the bits of the last release, or the CHANGELOG says why they do not."""

import json

import pytest

from tests.bits.record import TABLE
from tests.bits.runs import RUNS, made_with

KEPT = json.loads(TABLE.read_text("utf-8"))


def test_the_table_has_all_runs():
    assert list(KEPT["hashes"]) == list(RUNS)
    assert len(RUNS) >= 60


@pytest.mark.parametrize("name", RUNS)
def test_a_run_gives_the_bits_of_the_last_release(name):
    here = made_with()
    other = [
        f"{key} {here[key]}, not {was}"
        for key, was in KEPT["made with"].items()
        if here[key] != was
    ]
    if other:
        pytest.skip(f"the table was made with other libraries: {'; '.join(other)}")
    assert RUNS[name].hash() == KEPT["hashes"][name], (
        "the bits changed; if that is intended, run `python -m tests.bits.record`, and add a line "
        "with the reason to CHANGELOG.md"
    )
