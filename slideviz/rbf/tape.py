"""A tape of array operations, each with its exact derivative, forward and in reverse.

Arrays are (..., n, c): rows are nodes or constraints, columns their components, and leading axes
are directions (or designs) that are computed together. An operation takes constants (arrays) and
variables. Without a variable it is plain NumPy and is not recorded, so that the same code computes
values and derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Linear = Callable[[FloatArray], FloatArray]  # a linear map of arrays (..., n, c)

Link = tuple[Any, Linear, Linear]
"""An argument of an operation, and the operation's derivative with respect to it: from tangents of
the argument to those of the result, and from adjoints of the result to those of the argument."""


@record
class Variable:
    """The result of an operation on a tape."""

    value: FloatArray  # (n, c)
    tape: Tape
    place: int  # its number on the tape

    __array_ufunc__ = None

    def __add__(self, other: Array) -> Array:
        return add(self, other)

    __radd__ = __add__

    def __sub__(self, other: Array) -> Array:
        return add(self, -other)

    def __rsub__(self, other: Array) -> Array:
        return add(other, -self)

    def __neg__(self) -> Array:
        return recorded(-self.value, (self, np.negative, np.negative))

    def __mul__(self, other: Array | float) -> Array:
        return multiply(self, np.asarray(other, np.float64))

    __rmul__ = __mul__


Array = FloatArray | Variable


class Tape:
    """The operations of one evaluation, in order."""

    def __init__(self) -> None:
        self._links: list[list[tuple[int, Linear, Linear]]] = []

    def variable(self, value: FloatArray, links: Sequence[Link] = ()) -> Variable:
        """Return a new variable: an input, or with ``links`` the result of an operation."""
        self._links.append([(source.place, push, pull) for source, push, pull in links])
        return Variable(value, self, len(self._links) - 1)

    def push(self, start: Variable, tangent: FloatArray, end: Variable) -> FloatArray:
        """Return the derivative of ``end`` as ``start`` changes by ``tangent``; forward pass.

        ``tangent`` is (..., n, c) as ``start`` (n, c); the result is as ``end``.
        """
        found: dict[int, FloatArray] = {start.place: tangent}
        for place in range(start.place + 1, end.place + 1):
            for source, push, _ in self._links[place]:
                if source in found:
                    more = push(found[source])
                    found[place] = found[place] + more if place in found else more
        shape = (*tangent.shape[:-2], *end.value.shape)
        return np.broadcast_to(found.get(end.place, np.zeros(shape)), shape)

    def pull(self, end: Variable, adjoint: FloatArray, start: Variable) -> FloatArray:
        """Return the gradient of ``(adjoint * end).sum()`` with respect to ``start``; reverse pass.

        ``adjoint`` is (..., n, c) as ``end`` (n, c); the result is as ``start``.
        """
        found: dict[int, FloatArray] = {end.place: adjoint}
        for place in range(end.place, start.place, -1):
            if place not in found:
                continue
            here = found.pop(place)
            for source, _, pull in self._links[place]:
                more = pull(here)
                found[source] = found[source] + more if source in found else more
        shape = (*adjoint.shape[:-2], *start.value.shape)
        return np.broadcast_to(found.get(start.place, np.zeros(shape)), shape)


def value(x: Array) -> FloatArray:
    """Return the value of a variable, and a constant as it is."""
    return x.value if isinstance(x, Variable) else x


def recorded(result: FloatArray, *links: Link) -> Array:
    """Return ``result``, recorded on the tape with its links if any of them is of a variable."""
    used = [link for link in links if isinstance(link[0], Variable)]
    return used[0][0].tape.variable(result, used) if used else result


def linear(x: Array, there: Linear, back: Linear) -> Array:
    """Return the linear map ``there`` of x, recorded; ``back`` is its transpose."""
    return recorded(there(value(x)), (x, there, back))


def summed(total: FloatArray, *parts: Array) -> Array:
    """Return ``total``, the sum of parts of its shape, recorded."""

    def same(t: FloatArray) -> FloatArray:
        return t

    return recorded(total, *((part, same, same) for part in parts))


def over_columns(work: Linear, stacked: FloatArray) -> FloatArray:
    """Return ``work`` of arrays (..., n, c), done for the columns of all at once: (..., m, c)."""
    *ahead, n, c = stacked.shape
    wide = np.moveaxis(stacked, -2, 0).reshape(n, prod(ahead) * c)
    found = work(np.ascontiguousarray(wide))
    return np.ascontiguousarray(np.moveaxis(found.reshape(len(found), *ahead, c), 0, -2))


def _stretched(tangent: FloatArray, like: FloatArray) -> FloatArray:
    return (
        tangent if tangent.shape[-1] >= like.shape[-1] else np.repeat(tangent, like.shape[-1], -1)
    )


def _fitted(adjoint: FloatArray, like: FloatArray) -> FloatArray:
    """Return an adjoint, summed over columns if ``like``, the argument, has a single one."""
    if like.shape[-1] == 1 and adjoint.shape[-1] != 1:
        return adjoint.sum(axis=-1, keepdims=True)
    return adjoint


def add(a: Array, b: Array) -> Array:
    """Return a + b; one of them may have a single column."""
    x = value(a)
    y = value(b)
    return recorded(
        x + y,
        (a, lambda t: _stretched(t, y), lambda g: _fitted(g, x)),
        (b, lambda t: _stretched(t, x), lambda g: _fitted(g, y)),
    )


def multiply(a: Array, b: Array) -> Array:
    """Return a * b, element by element; one of them may have a single column."""
    x = value(a)
    y = value(b)
    return recorded(
        x * y,
        (a, lambda t: t * y, lambda g: _fitted(g * y, x)),
        (b, lambda t: t * x, lambda g: _fitted(g * x, y)),
    )


def divide(a: Array, b: Array) -> Array:
    """Return a / b, element by element; b may have a single column."""
    x = value(a)
    y = value(b)
    out = x / y
    return recorded(
        out,
        (a, lambda t: t / y, lambda g: g / y),
        (b, lambda t: -out / y * t, lambda g: _fitted(-out / y * g, y)),
    )


def function(x: Array, result: FloatArray, slope: FloatArray) -> Array:
    """Return ``result``, a function of each element of x, recorded with derivatives ``slope``."""
    return recorded(result, (x, lambda t: t * slope, lambda g: g * slope))


def inverse(x: Array) -> Array:
    """Return 1 / x."""
    one = 1.0 / value(x)
    return function(x, one, -one * one)


def dot(a: Array, b: Array) -> Array:
    """Return the scalar product of each row of a with the same row of b, (..., n, 1)."""
    x = value(a)
    y = value(b)

    def along(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.einsum("...d,...d->...", u, v)[..., None]

    return recorded(
        along(x, y),
        (a, lambda t: along(t, y), lambda g: g * y),
        (b, lambda t: along(x, t), lambda g: g * x),
    )


def length(x: Array) -> Array:
    """Return the length of each row, (..., n, 1); where it is 0 its derivative is 0 too."""
    v = value(x)
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    unit = v / np.where(size > 0, size, 1.0)
    return recorded(size, (x, lambda t: (t * unit).sum(axis=-1, keepdims=True), lambda g: g * unit))


def unit(x: Array) -> Array:
    """Return the rows at length 1; zero rows stay zero."""
    v = value(x)
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    e = v * scale

    def across(t: FloatArray) -> FloatArray:
        return (t - (t * e).sum(axis=-1, keepdims=True) * e) * scale

    return recorded(v / np.where(size > 0, size, 1.0), (x, across, across))


def cross(a: Array, b: Array) -> Array:
    """Return the cross product of each row of a with the same row of b, (..., n, 3)."""
    x = value(a)
    y = value(b)
    return recorded(
        np.cross(x, y),
        (a, lambda t: np.cross(t, y), lambda g: np.cross(y, g)),
        (b, lambda t: np.cross(x, t), lambda g: np.cross(g, x)),
    )


def transform(matrices: FloatArray, x: Array) -> Array:
    """Return ``matrices`` (n, e, d) or (e, d) times each row of x (..., n, d)."""
    there = "...ed,...d->...e"
    back = "...ed,...e->...d"
    return linear(x, partial(np.einsum, there, matrices), partial(np.einsum, back, matrices))


def product(a: Array, b: Array) -> Array:
    """Return the matrix product of a (n, q) and b (..., q, c)."""
    x = value(a)
    y = value(b)
    return recorded(
        x @ y,
        (a, lambda t: t @ y, lambda g: g @ np.swapaxes(y, -1, -2)),
        (b, lambda t: x @ t, lambda g: np.swapaxes(x, -1, -2) @ g),
    )


def reshape(x: Array, rows: int, columns: int) -> Array:
    """Return the entries of x (..., n, c), row by row, as (..., rows, columns)."""
    n, c = value(x).shape[-2:]
    return linear(
        x,
        lambda t: t.reshape(*t.shape[:-2], rows, columns),
        lambda g: g.reshape(*g.shape[:-2], n, c),
    )


def transpose(x: Array) -> Array:
    """Return x (..., n, c) with rows and columns exchanged, (..., c, n)."""

    def turned(t: FloatArray) -> FloatArray:
        return np.swapaxes(t, -1, -2)

    return linear(x, turned, turned)


def placed(values: FloatArray, rows: IntArray | slice, count: int) -> FloatArray:
    """Return an array (..., count, c) with ``values`` (..., m, c) in some rows (m,), else zero."""
    out = np.zeros((*values.shape[:-2], count, values.shape[-1]))
    out[..., rows, :] = values
    return out


def sums(values: FloatArray, rows: IntArray, count: int) -> FloatArray:
    """Return the sums (..., count, c) of ``values`` (..., m, c) with equal ``rows`` (m,)."""
    out = np.zeros((*values.shape[:-2], count, values.shape[-1]))
    np.add.at(out, (..., rows, slice(None)), values)  # type: ignore[arg-type]
    return out


def take(x: Array, rows: IntArray) -> Array:
    """Return the rows ``rows`` (m,) of x (..., n, c), (..., m, c); rows may occur repeatedly."""
    n = value(x).shape[-2]
    return linear(x, lambda t: t.take(rows, axis=-2), lambda g: sums(g, rows, n))


def gather(x: Array, rows: IntArray, count: int) -> Array:
    """Return the sums (..., count, c) of the rows of x (..., m, c) with equal ``rows`` (m,)."""
    return linear(x, lambda t: sums(t, rows, count), lambda g: g[..., rows, :])


def add_at(x: Array, rows: IntArray, more: Array) -> Array:
    """Return x (..., n, c) with ``more`` (..., m, c) added to rows (m,), which may repeat."""
    v = value(x)
    w = value(more)
    out = np.array(
        np.broadcast_to(v, (*np.broadcast_shapes(v.shape[:-2], w.shape[:-2]), *v.shape[-2:]))
    )
    np.add.at(out, (..., rows, slice(None)), w)  # type: ignore[arg-type]
    n = v.shape[-2]
    return recorded(
        out,
        (x, lambda t: t, lambda g: g),
        (more, lambda t: sums(t, rows, n), lambda g: g[..., rows, :]),
    )


def mixed(matrix: csr_array, x: Array) -> Array:
    """Return the product of a constant sparse matrix (m, n) and x (..., n, c), (..., m, c)."""
    return linear(
        x,
        partial(over_columns, matrix.__matmul__),
        lambda g: over_columns(matrix.T.tocsr().__matmul__, g),
    )


def put(x: Array, rows: IntArray, new: Array, *, overwrite: bool = False) -> Array:
    """Return x (..., n, c) with some rows (m,), each named once, replaced by ``new``.

    ``overwrite``: whether nothing else needs the values of x, so that they may be overwritten.
    """
    v = value(x)
    w = value(new)
    ahead = np.broadcast_shapes(v.shape[:-2], w.shape[:-2])
    fits = overwrite and v.shape[:-2] == ahead
    out = v if fits else np.array(np.broadcast_to(v, (*ahead, *v.shape[-2:])))
    out[..., rows, :] = w

    def without(t: FloatArray) -> FloatArray:
        kept = t.copy()
        kept[..., rows, :] = 0.0
        return kept

    alone = partial(placed, rows=rows, count=v.shape[-2])
    return recorded(out, (x, without, without), (new, alone, lambda g: g[..., rows, :]))


def join(*parts: Array) -> Array:
    """Return all parts (..., n_k, c), joined along their rows."""
    values = [value(part) for part in parts]
    ahead = np.broadcast_shapes(*(v.shape[:-2] for v in values))
    stops = np.cumsum([v.shape[-2] for v in values])
    total = int(stops[-1])
    links: list[Link] = []
    for part, v, stop in zip(parts, values, stops.tolist(), strict=True):
        here = slice(stop - v.shape[-2], stop)
        alone = partial(placed, rows=here, count=total)

        def cut(g: FloatArray, here: slice = here) -> FloatArray:
            return g[..., here, :]

        links.append((part, alone, cut))
    full = [np.broadcast_to(v, (*ahead, *v.shape[-2:])) for v in values]
    return recorded(np.concatenate(full, axis=-2), *links)


def solution(
    residual: Array, found: FloatArray, solve: Linear, adjoint: Linear | None = None
) -> Array:
    """Return ``found`` (n, m), the solution of A x = b, recorded with its derivative -A^-1 dr.

    A is symmetric.
    ``residual`` (n, m): r = A x - b on the tape, for the constant x = ``found``: its value does not
    matter.
    ``found``: the solution.
    ``solve`` and ``adjoint``: multiply with the inverse of A; ``adjoint`` in the reverse pass, if
    it needs another accuracy.
    """
    back = adjoint or solve
    return recorded(found, (residual, lambda t: -solve(t), lambda g: -back(g)))
