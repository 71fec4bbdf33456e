"""Coarse surfaces have fewer facets, no gaps, and stay where the boundaries are."""

import numpy as np
import pytest

from slideviz.mesh.surfaces import coarse_surfaces, find_surfaces
from slideviz.samples.table import sample


@pytest.fixture(scope="module")
def stator():
    mesh = sample("stator", size=6000).mesh
    return mesh, find_surfaces(mesh)


@pytest.fixture
def made(stator, monkeypatch):
    monkeypatch.setattr("slideviz.mesh.surfaces.LEAST", 0)
    mesh, surfaces = stator
    return mesh, surfaces, coarse_surfaces(surfaces, mesh.points, 12)


def areas(surface, points):
    a, b, c, d = (points[surface.nodes[column]] for column in surface.facets.T)
    return 0.5 * np.cross(c - a, d - b)


def test_there_are_fewer_facets_of_the_same_boundaries(made):
    _, surfaces, found = made
    assert [one.name for one in found] == [one.name for one in surfaces]
    assert sum(len(one.facets) for one in found) < 0.5 * sum(len(one.facets) for one in surfaces)


def test_the_whole_stays_closed(made):
    """By the divergence theorem the areas of a closed surface add up to nothing."""
    mesh, _, found = made
    every = np.concatenate([areas(one, mesh.points) for one in found])
    assert np.linalg.norm(every.sum(axis=0)) < 0.02 * np.linalg.norm(every, axis=1).sum()


def test_each_boundary_keeps_its_area_and_side(made):
    mesh, surfaces, found = made
    for whole, one in zip(surfaces, found, strict=True):
        before, after = areas(whole, mesh.points).sum(axis=0), areas(one, mesh.points).sum(axis=0)
        scale = np.linalg.norm(areas(whole, mesh.points), axis=1).sum()
        np.testing.assert_allclose(after, before, atol=0.06 * scale)


def test_a_facet_has_an_owner_that_the_boundary_has(made):
    _, surfaces, found = made
    for whole, one in zip(surfaces, found, strict=True):
        assert np.isin(one.owner, whole.owner).all()
        assert len(one.owner) == len(one.facets)


def test_no_facet_is_degenerate_or_stands_twice(made):
    for one in made[2]:
        nodes = one.nodes[one.facets]
        assert (np.array([len(set(row)) for row in nodes.tolist()]) >= 3).all()
        turned = {tuple(np.roll(row, -int(row.argmin()))) for row in nodes}
        assert len(turned) == len(nodes)


def test_corners_of_the_domain_stay(made):
    mesh, surfaces, found = made
    for whole, one in zip(surfaces, found, strict=True):
        for axis in range(3):
            before = mesh.points[whole.nodes, axis]
            after = mesh.points[one.nodes, axis]
            assert np.ptp(after) > 0.8 * np.ptp(before) - 1e-12


def test_small_meshes_and_flat_ones_have_none(stator):
    mesh, surfaces = stator
    assert coarse_surfaces(surfaces, mesh.points) == ()
    square = sample("square", size=5).mesh
    assert coarse_surfaces(find_surfaces(square), square.points) == ()
