"""The loops of `compiled` on a graphics card, in double precision: the source is in ``card.cu``.

Sums agree with those of the host but for rounding: each thread adds up in the order of the control
nodes, so that a target's sum does not depend on the others.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import _K, Inputs, Metric, one_at_a_time
from slideviz.rbf.kernels import SHAPE
from slideviz.system.device import card_arrays, free_on_card

TILE = 256  # threads of a block, and control nodes in shared memory at a time

PAIRS = 10_000_000_000  # pairs of a call, between two of ``tick``: some tens of milliseconds

ENTRIES = 1 << 26  # most entries of a matrix that are brought to the host at once: 512 MB

PRODUCT_ROWS = 16384  # most rows of a matrix that are multiplied at a time

PART = 4  # of the card's free memory, the arrays of a call take at most one over this

TARGET_BYTES = 64  # of a target of a sum: four features, three components


@cache
def _kernel(module: Any, name: str, kind: int, rows: int, periodic: bool) -> Any:
    """Return a function of ``card.cu``, compiled for a kernel and a rule of distance."""
    given = {
        "KIND": kind,
        "ROWS": rows,
        "PERIODIC": int(periodic),
        "SHAPE": repr(SHAPE),
        "COEFFICIENTS": ",".join(map(repr, _K)),
        "TILE": TILE,
    }
    options = tuple(f"-D{name}={value}" for name, value in given.items())
    code = Path(__file__).with_name("card.cu").read_text(encoding="utf-8")
    return module.RawModule(code=code, options=options).get_function(name)


def _run(name: str, threads: int, inputs: Inputs, metric: Metric, out: Any) -> Any:
    """Return ``out``, on the card, which a function of ``card.cu`` fills from inputs on the host.

    ``inputs``: features of targets (k, N) and controls (k, n), and one or two other arrays.
    """
    if not threads:
        return out
    module = card_arrays().module
    x, c, *others = inputs
    period_over_pi, scale, kind = metric
    sizes = x.shape[1], c.shape[1], len(others[0])
    _kernel(module, name, kind, len(x), period_over_pi > 0.0)(
        (-(-threads // TILE),),
        (TILE,),
        (
            *map(module.asarray, inputs),
            *map(np.int64, sizes),
            np.float64(period_over_pi),
            np.float64(scale),
            out,
        ),
    )
    return out


class CardLoops:
    """The loops on a card; arguments and results are on the host, as of `HostLoops`."""

    def sum_rows(self, count: int) -> int:
        """Return how many targets to sum up at a time, with ``count`` control nodes."""
        return max(1, min(PAIRS // max(1, count), free_on_card() // (PART * TARGET_BYTES)))

    def matrix_rows(self, count: int) -> int:
        """Return how many rows of a matrix with ``count`` columns to fill at a time."""
        most = min(ENTRIES, free_on_card() // (PART * np.dtype(float).itemsize))
        return max(1, most // max(1, count))

    def product_rows(self, count: int) -> int:
        """Return how many rows of a matrix to fill at a time, when they are multiplied."""
        return min(self.matrix_rows(count), PRODUCT_ROWS)

    def add_up(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """As of `HostLoops`."""
        arrays = card_arrays()
        found = arrays.module.empty(out.shape)
        out[:] = arrays.to_host(_run("add_up", out.shape[1], inputs, metric, found))

    def fill_matrix(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """As of `HostLoops`."""
        out[:] = card_arrays().to_host(self._filled(inputs, metric))

    def multiply(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """As of `HostLoops`."""
        x, c, right = inputs
        arrays = card_arrays()
        with one_at_a_time(x.shape[1] * c.shape[1]):  # threads share the memory of the card
            filled = self._filled((x, c, x[:0], c[:0]), metric)
            out[:] = arrays.to_host(filled @ arrays.module.asarray(right))

    def _filled(self, inputs: Inputs, metric: Metric) -> Any:
        """Return G (N, n), on the card."""
        x, c, *_ = inputs
        out = card_arrays().module.empty((x.shape[1], c.shape[1]))
        return _run("fill_matrix", out.size, inputs, metric, out)
