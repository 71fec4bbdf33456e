"""Measure a graphics card: speed over that of all cores, and errors against these.

``python -m tools.gpu`` prints a table, in some three minutes; without a card it prints a line.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Callable
from dataclasses import replace
from math import pi
from time import perf_counter

import numpy as np

from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.operations import many
from slideviz.rbf.solve import NOTHING, extend
from slideviz.system.device import arrays_at, card_name, why_no_card
from slideviz.system.threads import cores
from slideviz.terms import KERNELS

TARGETS = 10_000_000
CONTROLS = 20_000
SHARE = 10  # of the targets, the cores sum up one in so many: their time is proportional

MOST = 1e-12  # error, over the largest value

WANTED = 50.0  # times the speed of 16 cores, for the sums

Work = Callable[[Basis, int], np.ndarray]
"""Returns a result for a basis, of one in so many targets."""


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def timed(work: Work, basis: Basis, share: int = 1) -> tuple[float, np.ndarray]:
    """Return the seconds that ``work`` takes, and its result."""
    begin = perf_counter()
    result = work(basis, share)
    return perf_counter() - begin, result


def rows(targets: int, controls: int) -> list[tuple[str, Basis, int, Work]]:
    """Return what is measured: name, basis, share of the work that the cores do, and the work."""
    rng = np.random.default_rng(0)
    x, c = (rng.uniform(-1.0, 1.0, (3, count)) for count in (targets, controls))
    weights = rng.normal(size=(controls, 3))
    angle = rng.uniform(0.0, 2.0 * pi, targets)
    r, z = rng.uniform(0.1, 1.0, (2, targets))
    turned = np.stack([r, np.sin(angle), np.cos(angle), z])
    designs = rng.normal(size=(16, controls, 3))

    def sums(basis: Basis, share: int) -> np.ndarray:
        return evaluate(basis, x[:, : targets // share], c, weights)

    def few(basis: Basis, share: int) -> np.ndarray:
        return evaluate(basis, x[:, : targets // (10 * share)], c, weights)

    def periodic(basis: Basis, share: int) -> np.ndarray:
        return evaluate(basis, turned[:, : targets // (10 * share)], turned[:, :controls], weights)

    def products(basis: Basis, share: int) -> np.ndarray:
        return many(basis, x[:, : targets // (50 * share)], c, designs)

    def filled(basis: Basis, _: int) -> np.ndarray:
        return matrix(basis, (c, None))

    system = matrix(Basis(0.5), (c, None))

    def factor(basis: Basis, _: int) -> np.ndarray:
        lower = extend(NOTHING, system, arrays=arrays_at(basis.place)).lower
        return lower @ (lower.T @ weights)  # the factor's own errors are those of the condition

    plain = Basis(2.5)
    return [
        (f"sums, {targets:,} x {controls:,}", plain, SHARE, sums),
        *((f"sums, {name}", Basis(2.5, kernel=name), SHARE, few) for name in KERNELS),
        ("sums, period", Basis(2.5, period=pi / 6), SHARE, periodic),
        ("16 designs", plain, SHARE, products),
        (f"matrix, {controls:,}", plain, 1, filled),
        (f"factor, {controls:,}", plain, 1, factor),
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the table; 1 where a result differs by more than `MOST`."""
    parser = ArgumentParser(prog="python -m tools.gpu", description=__doc__)
    parser.add_argument("--targets", type=int, default=TARGETS)
    parser.add_argument("--controls", type=int, default=CONTROLS)
    given = parser.parse_args(arguments)
    if lacking := why_no_card():
        _say(f"gpu: nothing is measured: {lacking}")
        return 0
    _say(f"{card_name()}, and {cores()} cores")
    _say(f"{'':<30}{'card, s':>10}{'cores, s':>10}{'times':>8}{'error':>10}")
    wrong = 0
    for name, basis, share, work in rows(given.targets, given.controls):
        on_card = replace(basis, place="gpu")
        work(on_card, 100 * share)  # compiles
        card, found = timed(work, on_card)
        part, wanted = timed(work, basis, share)
        host = part * share
        error = np.abs(found[..., : wanted.shape[-2], :] - wanted).max() / np.abs(wanted).max()
        wrong += not error <= MOST
        times = host / card
        _say(f"{name:<30}{card:>10.3g}{host:>10.3g}{times:>8.1f}{error:>10.1e}")
    _say(f"asked for: the first row {WANTED:g} times 16 cores; errors below {MOST:g}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
