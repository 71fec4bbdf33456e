"""Forces of an elastic body, f = K(x) u, and derivatives with respect to the node positions x.

With G the gradient of the displacement u, and its stress per modulus of the cell

    S = lam tr(G) I + mu (G + G^T),

the force at node a is the sum of E |det J| w S grad N_a over the integration points of its
elements (see `slideviz.elastic.stiffness`). Where positions change by t, with gradient T,

    dG = -G T,     d grad N_a = -T^T grad N_a,     d|det J| = |det J| tr T,

and the modulus E, the inverse of the cell's volume, changes by -E dV / V.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from slideviz.elastic.corotated import LAM, MU, Corotated
from slideviz.elastic.stiffness import ShapeBlock, _gather, _jacobian, cell_volumes
from slideviz.mesh.model import FloatArray, IntArray, sealed
from slideviz.system.jit_cache import OPTIONS, njit


@dataclass(frozen=True, eq=False)
class Forces:
    """Computes the forces of a body, and their derivatives."""

    points: FloatArray  # (n, d): positions of the nodes
    parts: list[ShapeBlock]  # the elements
    volume: FloatArray  # (c,): volume (area in 2D) of each cell

    @classmethod
    def at(cls, points: FloatArray, parts: list[ShapeBlock]) -> Forces:
        """Return the forces of a body with its nodes at ``points`` (n, d)."""
        return cls(points, parts, cell_volumes(points, parts))

    def of(self, moved: FloatArray) -> FloatArray:
        """Return the forces (n, d) of a displacement (n, d)."""
        return self._body.product(None, moved)

    @cached_property
    def _body(self) -> Corotated:
        moduli = tuple(sealed(self._modulus(part)) for part in self.parts)
        return Corotated(self.points, self.parts, moduli)

    def pushed(self, moved: FloatArray, by: FloatArray) -> FloatArray:
        """Return the change (n, d) of the forces of ``moved`` as positions change by ``by``."""
        out, swelling = np.zeros_like(self.points), np.zeros_like(self.volume)
        for part in self.parts:
            each = np.empty(len(part.nodes))
            swell(self._elements(part), by, each)
            swelling[part.cell] = each
        rate = swelling / self.volume
        for part in self.parts:
            modulus = self._modulus(part)
            push(self._elements(part), modulus, rate[part.cell], moved, by, out)
        return out

    def pulled(self, moved: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the gradient (n, d) of ``(weights * forces).sum()`` with respect to positions."""
        out, work = np.zeros_like(self.points), np.zeros_like(self.volume)
        for part in self.parts:
            each = np.empty(len(part.nodes))
            pull(self._elements(part), self._modulus(part), moved, weights, out, each)
            work[part.cell] = each
        rate = work / self.volume
        for part in self.parts:
            press(self._elements(part), -rate[part.cell], out)
        return out

    def _elements(self, part: ShapeBlock) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
        # As those of a mesh are, which they are no more when they were sent to another process.
        points, nodes = sealed(self.points), sealed(part.nodes)
        return points, nodes, part.shape.gradients, part.shape.weights

    def _modulus(self, part: ShapeBlock) -> FloatArray:
        """Return Young's modulus of each element, (m,)."""
        return np.asarray(1.0 / self.volume[part.cell])


@njit(**OPTIONS)
def _at(elements, e, q, x, inverse, slopes):  # type: ignore[no-untyped-def]
    """Write grad N_a (a, d) at integration point q of element e to ``slopes``; return |det J| w."""
    points, nodes, gradients, weights = elements
    n, d = x.shape
    _gather(points, nodes, e, x)
    size = abs(_jacobian(x, gradients, q, inverse)) * weights[q]
    for a in range(n):
        for i in range(d):
            total = 0.0
            for j in range(d):
                total += inverse[i, j] * gradients[q, a, j]
            slopes[a, i] = total
    return size


@njit(**OPTIONS)
def _gradient(nodes, e, field, slopes, out):  # type: ignore[no-untyped-def]
    """Write the gradient (d, d) of a nodal field (n, d) in element e to ``out``; return its trace.

    The first index is the component of the field.
    """
    n, d = slopes.shape
    out[:] = 0.0
    for a in range(n):
        for i in range(d):
            for j in range(d):
                out[i, j] += field[nodes[e, a], i] * slopes[a, j]
    trace = 0.0
    for i in range(d):
        trace += out[i, i]
    return trace


@njit(**OPTIONS)
def _stress(gradient, trace, out):  # type: ignore[no-untyped-def]
    """Write the stress S (d, d) for a modulus of 1 to ``out``."""
    for i in range(len(out)):
        for j in range(len(out)):
            out[i, j] = MU * (gradient[i, j] + gradient[j, i])
        out[i, i] += LAM * trace


@njit(**OPTIONS)
def _spread(nodes, e, slopes, size, what, out):  # type: ignore[no-untyped-def]
    """Add ``size`` times ``what`` (d, d) times grad N_a to the nodes of element e in ``out``."""
    n, d = slopes.shape
    for a in range(n):
        for i in range(d):
            total = 0.0
            for j in range(d):
                total += what[i, j] * slopes[a, j]
            out[nodes[e, a], i] += size * total


@njit(**OPTIONS)
def swell(elements, by, out):  # type: ignore[no-untyped-def]
    """Write the change of each element's volume as positions change by ``by`` (n, d) to ``out``."""
    nodes, d = elements[1], elements[0].shape[1]
    x, slopes = np.empty((nodes.shape[1], d)), np.empty((nodes.shape[1], d))
    inverse, t = np.empty((3, 3)), np.empty((d, d))
    for e in range(len(nodes)):
        out[e] = 0.0
        for q in range(len(elements[3])):
            size = _at(elements, e, q, x, inverse, slopes)
            out[e] += size * _gradient(nodes, e, by, slopes, t)


@njit(**OPTIONS)
def press(elements, by, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` (n, d) the gradient of the sum of element volumes, each times ``by`` (m,)."""
    nodes, d = elements[1], elements[0].shape[1]
    x, slopes = np.empty((nodes.shape[1], d)), np.empty((nodes.shape[1], d))
    inverse, one = np.empty((3, 3)), np.eye(d)
    for e in range(len(nodes)):
        for q in range(len(elements[3])):
            size = _at(elements, e, q, x, inverse, slopes) * by[e]
            _spread(nodes, e, slopes, size, one, out)


@njit(**OPTIONS)
def push(elements, modulus, rate, moved, by, out):  # type: ignore[no-untyped-def]
    """Add to ``out`` the change of the forces as positions change by ``by`` (n, d).

    ``rate`` (m,) is the relative change of the volume of each element's cell.
    """
    nodes, d = elements[1], elements[0].shape[1]
    x, slopes = np.empty((nodes.shape[1], d)), np.empty((nodes.shape[1], d))
    inverse, g, t = np.empty((3, 3)), np.empty((d, d)), np.empty((d, d))
    s, ds, dg = np.empty((d, d)), np.empty((d, d)), np.empty((d, d))
    for e in range(len(nodes)):
        for q in range(len(elements[3])):
            size = _at(elements, e, q, x, inverse, slopes) * modulus[e]
            _stress(g, _gradient(nodes, e, moved, slopes, g), s)
            more = _gradient(nodes, e, by, slopes, t) - rate[e]
            trace = 0.0
            for i in range(d):
                for j in range(d):
                    dg[i, j] = 0.0
                    for k in range(d):
                        dg[i, j] -= g[i, k] * t[k, j]
                trace += dg[i, i]
            _stress(dg, trace, ds)
            for i in range(d):
                for j in range(d):
                    ds[i, j] += more * s[i, j]
                    for k in range(d):
                        ds[i, j] -= s[i, k] * t[j, k]
            _spread(nodes, e, slopes, size, ds, out)


@njit(**OPTIONS)
def pull(elements, modulus, moved, weights, out, work):  # type: ignore[no-untyped-def]
    """Add to ``out`` the gradient of weights (n, d) times forces at constant modulus.

    Write each element's part of weights times forces to ``work`` (m,). With L the gradient of the
    weights and S_L its stress, the derivative is (S : L) tr T - S : (L T) - S_L : (G T).
    """
    nodes, d = elements[1], elements[0].shape[1]
    x, slopes = np.empty((nodes.shape[1], d)), np.empty((nodes.shape[1], d))
    inverse, g, w = np.empty((3, 3)), np.empty((d, d)), np.empty((d, d))
    s, r, m = np.empty((d, d)), np.empty((d, d)), np.empty((d, d))
    for e in range(len(nodes)):
        work[e] = 0.0
        for q in range(len(elements[3])):
            size = _at(elements, e, q, x, inverse, slopes) * modulus[e]
            _stress(g, _gradient(nodes, e, moved, slopes, g), s)
            _stress(w, _gradient(nodes, e, weights, slopes, w), r)
            total = 0.0
            for i in range(d):
                for j in range(d):
                    total += s[i, j] * w[i, j]
                    m[i, j] = 0.0
                    for k in range(d):
                        m[i, j] -= w[k, i] * s[k, j] + g[k, i] * r[k, j]
            for i in range(d):
                m[i, i] += total
            work[e] += size * total
            _spread(nodes, e, slopes, size, m, out)
