"""Numbers in SU2 text: to the nearest float64, and with the fewest digits when written."""

import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from slideviz.errors import MeshError
from slideviz.formats.files import write
from slideviz.formats.source import open_source
from slideviz.formats.su2.loops import point_block
from slideviz.formats.su2.read import read_su2
from slideviz.mesh.model import Cells, Mesh
from tests.formats.su2_samples import bits, save

MANY = 100_000


def text_of(words: list[str]) -> bytes:
    """Return rows of points, two words each."""
    return "".join(f"{x} {y}\n" for x, y in zip(words[::2], words[1::2], strict=True)).encode()


def points_of(path) -> np.ndarray:
    """Return the points of a file, also those that are too large to compute with."""
    return read_su2(open_source(path), None, lambda _: None).points


def read_words(folder, words: list[str]) -> np.ndarray:
    """Return the coordinates of a mesh with these words as coordinates."""
    words = [*words, *("0" * (len(words) % 2)), *"010101"]
    rows = text_of(words)
    head = f"NDIME= 2\nNELEM= 1\n5 0 1 2\nNPOIN= {len(words) // 2}\n".encode()
    return points_of(save(folder, head + rows + b"NMARK= 0\n")).ravel()[: len(words)]


def compiled(words: list[str]) -> tuple[np.ndarray, set[int]]:
    """Return the numbers that the compiled loop finds, and the rows that it leaves."""
    points, extra = np.empty((len(words) // 2, 2)), np.array([0, len(words)])
    odd = np.empty((len(points), 2), np.int64)
    text = np.frombuffer(text_of(words), np.uint8)
    rows, left = point_block(text, 0, points.view(np.uint64), extra, odd)
    assert rows == len(points)
    return points, set(odd[:left, 0].tolist())


def spread(rng: np.random.Generator) -> list[float]:
    """Return float64 of any bits that are finite."""
    found = np.frombuffer(rng.bytes(8 * MANY), float)
    return found[np.isfinite(found)][: MANY - MANY // 10].tolist()


def usual(rng: np.random.Generator) -> list[float]:
    return (rng.normal(size=MANY) * 10.0 ** rng.integers(-12, 6, MANY)).tolist()


def halfway(rng: np.random.Generator) -> list[str]:
    """Return numbers just between two float64, and just beside that."""
    words = []
    mantissas = rng.integers(2**52, 2**53, MANY // 40).tolist()
    for m, e in zip(mantissas, rng.integers(-80, 80, MANY // 40).tolist(), strict=True):
        middle = (2 * m + 1) << max(e, 0)
        middle *= 5 ** max(-e, 0)
        words += [f"{10 * middle + d}e{min(e, 0) - 1}" for d in (-1, 0, 1)]
        words += [f"{middle}E{min(e, 0):+d}"]
    return words


# The words, and the most of their rows that the loop may leave to Python.
KINDS = {
    "shortest": (lambda r: [repr(x) for x in usual(r)], 0.0),
    "17 digits": (lambda r: [f"{x:.16e}" for x in usual(r)], 0.0),
    "19 digits": (lambda r: [f"{x:.18e}" for x in usual(r)], 0.0),
    "26 digits": (lambda r: [f"{x:.25E}" for x in usual(r)], 0.001),
    "fixed": (lambda r: [f"{x:+.9f}" for x in usual(r)], 0.0),
    "long fixed": (lambda r: [f"{x:.40f}" for x in usual(r)], 0.001),
    "whole": (lambda r: [str(n) for n in r.integers(-(2**62), 2**62, MANY).tolist()], 0.0),
    "all": (lambda r: [repr(x) for x in spread(r)], 0.01),
    "all, 17 digits": (lambda r: [f"{x:.16e}" for x in spread(r)], 0.01),
    "any exponent": (
        lambda r: [
            f"{w}e{q}"
            for w, q in zip(
                r.integers(0, 2**63, MANY).tolist(),
                r.integers(-400, 350, MANY).tolist(),
                strict=True,
            )
        ],
        0.5,
    ),
    "halfway": (halfway, 1.0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_loop_is_right_or_leaves_it(kind):
    make, most_left = KINDS[kind]
    words = make(np.random.default_rng(list(kind.encode())))
    words = words[: len(words) // 2 * 2]
    points, left = compiled(words)
    expected = np.array([float(word) for word in words]).reshape(-1, 2)
    done = np.ones(len(points), bool)
    done[list(left)] = False
    assert len(left) <= most_left * len(points)
    assert bits(points[done]) == bits(expected[done])


digits = st.text("0123456789", max_size=30)
words = st.builds(
    lambda sign, whole, part, e, exponent: f"{sign}{whole}{part}{e}{exponent if e else ''}",
    st.sampled_from(["", "+", "-"]),
    digits,
    st.one_of(st.just(""), digits.map(lambda text: f".{text}")),
    st.sampled_from(["", "e", "E", "e+", "E-", "e-", "d"]),
    st.one_of(st.integers(0, 400).map(str), st.just(""), st.just("00000000005")),
)


@settings(max_examples=300, deadline=None)
@given(word=words)
@example(word="5e-324")
@example(word="2.2250738585072011e-308")
@example(word="1.7976931348623157e308")
@example(word="1.7976931348623159e308")
@example(word="9007199254740993")
@example(word="1.E5")
@example(word=".5")
@example(word="1_0")
@example(word="١")
@example(word="1d5")
@example(word="1e")
@example(word="-.")
@example(word="-0")
@example(word="0e99999999")
@example(word="1e-99999999")
def test_a_word_is_what_python_takes_it_for(tmp_path_factory, word):
    folder = tmp_path_factory.mktemp("word")
    plain = re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", word, re.ASCII)
    if plain and np.isfinite(float(word)):
        assert bits(read_words(folder, ["0.5", word])[1:2]) == bits(np.array([float(word)]))
        return
    message = "is not finite" if plain else "expected a number, found|but this line has"
    with pytest.raises(MeshError, match=f"grid.su2:5: .*({message})"):
        read_words(folder, ["0.5", word])


def test_numbers_between_two_float64(tmp_path):
    found = halfway(np.random.default_rng(1))
    expected = np.array([float(word) for word in found])
    assert bits(read_words(tmp_path, found)[: len(found)]) == bits(expected)
    # They are what they are called: a middle is as far from one neighbour as from the other.
    middle, near = Fraction(found[3]), float(found[3])
    other = np.nextafter(near, np.inf if middle > Fraction(near) else -np.inf)
    assert middle - Fraction(near) == Fraction(float(other)) - middle


@pytest.mark.parametrize("kind", [usual, spread])
def test_written_numbers_are_short_and_come_back(tmp_path, kind):
    points = np.array(kind(np.random.default_rng(7))[:60_000]).reshape(-1, 3)
    mesh = Mesh(points, Cells.from_blocks([(10, [[0, 1, 2, 3]])]))
    write(tmp_path / "out.su2", mesh)
    assert bits(points_of(tmp_path / "out.su2")) == bits(points)
    rows = (tmp_path / "out.su2").read_text().partition("NPOIN=")[2].splitlines()[1:-1]
    found = [word for row in rows for word in row.split()[:3]]
    assert [row.split()[3] for row in rows] == [str(k) for k in range(len(points))]
    assert max(map(len, found)) <= 24
    assert all(
        significant(word) == significant(repr(x))
        for word, x in zip(found, points.ravel().tolist(), strict=True)
    )


def significant(word: str) -> str:
    """Return the digits of a number without zeros on either side."""
    return re.sub(r"e.*|\D", "", word).strip("0")
