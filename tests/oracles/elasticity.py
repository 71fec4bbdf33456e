"""The stiffness of an elastic mesh by scikit-fem's own assembly."""

from __future__ import annotations

import numpy as np
import skfem
from skfem.helpers import ddot, eye, sym_grad, trace
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

MESHES = {
    5: (skfem.MeshTri1, skfem.ElementTriP1, [0, 1, 2]),
    9: (skfem.MeshQuad1, skfem.ElementQuad1, [0, 1, 2, 3]),
    10: (skfem.MeshTet1, skfem.ElementTetP1, [0, 1, 2, 3]),
    12: (skfem.MeshHex1, skfem.ElementHex1, [6, 2, 5, 7, 1, 3, 4, 0]),
    13: (skfem.MeshWedge1, skfem.ElementWedge1, [0, 1, 2, 3, 4, 5]),
}


def prism_rule():
    """Gauss points: scikit-fem's own rule for prisms has its centre at x = 1/2, not 1/3."""
    (flat, area), (height, length) = (get_quadrature(refdom, 4) for refdom in (RefTri, RefLine))
    points = [(*flat[:, i], height[0, k]) for i in range(len(area)) for k in range(len(length))]
    weights = [a * b for a in area for b in length]
    return np.array(points).T, np.array(weights)


def stiffness(points, vtk: int, nodes, poisson: float = 0.3, modulus=None) -> np.ndarray:
    """Dense matrix (n d, n d), dofs node by node.

    ``modulus`` (m,): Young's modulus of each cell; None: the inverse of its volume.
    """
    mesh_type, element, order = MESHES[vtk]
    mesh = mesh_type(points.T, np.asarray(nodes)[:, order].T.copy())
    rule = {"quadrature": prism_rule()} if vtk == 13 else {"intorder": 4}
    basis = skfem.Basis(mesh, skfem.ElementVector(element()), **rule)
    modulus = (1.0 / basis.dx.sum(axis=1) if modulus is None else modulus)[:, None]

    @skfem.BilinearForm
    def form(u, v, w):
        strain, other = sym_grad(u), sym_grad(v)
        mu = w.e / (2 * (1 + poisson))
        lam = w.e * poisson / ((1 + poisson) * (1 - 2 * poisson))
        dim = len(points.T)
        return ddot(2 * mu * strain + eye(lam * trace(strain), dim), other)

    found = form.assemble(basis, e=modulus * np.ones_like(basis.dx)).toarray()
    order = basis.nodal_dofs.T.ravel()
    return found[np.ix_(order, order)]
