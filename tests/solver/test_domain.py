"""Domains: what of a mesh with roles is the same for all motions."""

import numpy as np

import slideviz as sv
from slideviz.rbf.classify import directions
from slideviz.solver.domain import find_domain
from tests import builders

ROLES = {"hub": "sliding", "blade": "moving", "per1": "periodic", "per2": "periodic"}


def test_normals_of_a_wall_do_not_turn_with_a_blade_that_leaves_it():
    case = sv.Case(roles=ROLES, periodic_type="rotational", sliding="ps")
    mesh = builders.passage((3, 6, 6), 40.0)
    domain = find_domain(case, mesh)
    assert len(domain.wall_fans.facet) < len(domain.fans.facet)
    off = domain.coords.copy()
    off[domain.classes.moving, 0] += 0.02
    nodes, normals = directions(domain.classes, domain.normals_at(off))
    hub = np.intersect1d(domain.classes.surface, mesh.marker("hub").nodes)
    surface = np.isin(nodes, hub)
    assert surface.any()
    # In cylindrical coordinates the hub is flat.
    assert np.abs(np.abs(normals[surface]) - [1.0, 0.0, 0.0]).max() < 1e-12
