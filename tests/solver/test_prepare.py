"""A case is checked once, however many zones its mesh has."""

from collections import Counter

import pytest

import slideviz as sv
from slideviz.case import check, moving_nodes
from slideviz.errors import CaseError
from slideviz.mesh.zones import zones_of
from slideviz.solver.prepare import prepare
from tests.solver.test_interface_motion import both, roles_of, stage, turn


@pytest.fixture
def walked(monkeypatch):
    """Count how often the motions of a mesh are checked, by its zone."""
    counts = Counter()
    original = check.motion_problems

    def counted(case, mesh):
        counts[mesh.zone] += 1
        return original(case, mesh)

    monkeypatch.setattr(check, "motion_problems", counted)
    monkeypatch.setattr(moving_nodes, "motion_problems", counted)
    return counts


def test_motions_are_checked_once_in_a_run_and_in_a_deformer(tmp_path, walked):
    mesh = sv.read(stage(tmp_path), 1)
    case = sv.Case(roles=roles_of(""), motions=(turn(""),))
    list(sv.deform(case, mesh))
    assert walked == {1: 1}
    sv.Deformer(mesh, case)
    assert walked == {1: 2}


def test_motions_of_each_zone_are_checked_once(tmp_path, walked):
    list(sv.deform(both(), sv.read(stage(tmp_path))))
    assert walked == {1: 1, 2: 1}


def test_each_zone_has_its_case_with_the_names_of_its_file(tmp_path):
    mesh = sv.read(stage(tmp_path))
    prepared = prepare(both(), mesh)
    assert [zone.mesh for zone in prepared.zones] == list(zones_of(mesh))
    assert [zone.case.markers_with("moving") for zone in prepared.zones] == [("BLOCK",)] * 2
    alone = sv.read(stage(tmp_path), 2)
    assert [zone.mesh for zone in prepare(both(), alone).zones] == [alone]
    with pytest.raises(CaseError, match="no marker moves"):
        prepare(sv.Case(), alone)
