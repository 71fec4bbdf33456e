"""Round numbers along an axis, their digits, and round ends of a range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slideviz.plots.ticks import bar_ticks, rounded_out, tick_format, ticks

ranges = st.tuples(st.floats(-1e3, 1e3), st.floats(1e-4, 1e6)).map(lambda r: (r[0], r[0] + r[1]))


@given(ranges)
def test_ticks_are_in_the_range_and_no_label_looks_like_another(ends):
    low, high = ends
    at = ticks(low, high)
    room = 1e-5 * (high - low)
    assert 2 <= len(at) <= 8
    assert at[0] >= low - room
    assert at[-1] <= high + room
    assert np.allclose(np.diff(at), at[1] - at[0])
    labels = [tick_format(at) % value for value in at]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("ends", "labels"),
    [
        ((0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        ((0.949, 0.967), ["0.950", "0.955", "0.960", "0.965"]),
        ((0.0, 1.5), ["0.00", "0.25", "0.50", "0.75", "1.00", "1.25", "1.50"]),
        ((0.0, 10000.0), ["0", "2000", "4000", "6000", "8000", "10000"]),
        ((0.0, 2.5e-6), ["0.0e+00", "5.0e-07", "1.0e-06", "1.5e-06", "2.0e-06", "2.5e-06"]),
    ],
)
def test_labels_have_the_digits_of_their_distance(ends, labels):
    at = ticks(*ends)
    assert [tick_format(at) % value for value in at] == labels


@given(ranges)
def test_round_ends_enclose_the_range_and_leave_little_empty(ends):
    low, high = ends
    first, last = rounded_out(low, high)
    room = 1e-6 * (high - low)
    assert first <= low + room
    assert high - room <= last
    assert last - first <= 3 * (high - low)


def test_round_ends():
    assert rounded_out(0.9491, 0.9672) == (0.948, 0.968)
    assert rounded_out(0.12, 0.97) == (0.1, 1.0)
    low, high = rounded_out(0.5, 0.5)
    assert low < 0.5 < high, "one value alone has room on both sides"


@given(ranges, st.floats(0.02, 0.4))
def test_a_bar_has_its_ends_and_numbers_that_do_not_run_together(ends, part):
    at, form = bar_ticks(*ends, lambda _: part)
    assert (at[0], at[-1]) == ends
    if len(at) > 2:
        assert np.diff(at).min() >= part * (ends[1] - ends[0])
    labels = [form % value for value in at]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(
    ("ends", "part", "labels"),
    [
        ((0.946, 0.967), 0.1, ["0.946", "0.950", "0.955", "0.960", "0.967"]),
        ((0.946, 0.967), 0.4, ["0.946", "0.967"]),
        ((0.0, 1.0), 0.05, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        ((0.0, 0.123), 0.1, ["0.000", "0.025", "0.050", "0.075", "0.100", "0.123"]),
        ((0.0, 2.5e-6), 0.2, ["0.0e+00", "1.0e-06", "2.5e-06"]),
    ],
)
def test_numbers_of_a_bar(ends, part, labels):
    at, form = bar_ticks(*ends, lambda _: part)
    assert [form % value for value in at] == labels
