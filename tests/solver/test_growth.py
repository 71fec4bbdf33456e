"""Nodes that leave hub or shroud, where blades move over the span."""

import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.solver.growth import Farthest, farthest_node
from slideviz.streaming.run import stream
from tests.builders import cut_blade, passage
from tests.machine.test_span_field import contoured

ROLES = {"blade": "moving", "hub": "sliding", "shroud": "sliding", "per1": "periodic"}
LEAN = sv.SpanMotion("blade", "lean", (0.0, 1.0), (0.08, 0.12))
CASE = sv.Case(
    roles=ROLES | {"per2": "periodic"},
    motions=(LEAN,),
    periodic_type="rotational",
    periodic="moving",
    sliding="ps",
    relax="no",
    layers="no",
)


def off_wall(case, mesh):
    *_, last = sv.deform(case.change(steps=2), mesh)
    return [text for text in last.warnings if "has left" in text]


def test_nodes_that_leave_a_contoured_hub_where_a_cut_blade_stood_are_named(tmp_path):
    mesh = contoured(cut_blade((6, 12, 8)))
    (text,) = off_wall(CASE.change(repair="no"), mesh)
    assert text.startswith("node 85 of hub at (0.459")
    assert r"by 0.006" in text
    assert "its shape is not known where the blade stood; move the blade less, or let no" in text
    assert text.endswith("or let no periodic side cut the blade")
    sv.write(tmp_path / "mesh.su2b", mesh)
    file = CASE.change(mesh_file=tmp_path / "mesh.su2b", steps=2, repair="no")
    assert text in stream(file, tmp_path / "out.su2b").steps[-1].warnings
    assert text in sv.Deformer(mesh, CASE.change(steps=2, repair="no")).warnings
    assert not off_wall(CASE.change(roles=ROLES | {"per2": "periodic", "hub": "internal"}), mesh)
    small = sv.SpanMotion("blade", "lean", (0.0,), (0.02,))
    assert not off_wall(CASE.change(motions=(small,)), mesh)


def test_a_blade_that_other_motions_take_off_the_hub_is_named():
    mesh = passage((4, 6, 8))
    assert not off_wall(CASE, mesh)
    turned = CASE.change(motions=(sv.Rotate("blade", 10.0, (0.0, 0.0, 0.0)), LEAN))
    texts = off_wall(turned, mesh)
    assert [re.findall("has left (.*) by", text) for text in texts] == [["hub"], ["shroud"]]
    assert all(text.endswith("; RIMS= SLIDE keeps such nodes on it") for text in texts)
    assert not off_wall(turned.change(rims="slide"), mesh)


@pytest.mark.slow
def test_a_curved_wall_may_be_left_as_far_as_its_facets_are_off():
    from slideviz.samples.table import sample

    row = sample("impeller", 3000)
    assert not off_wall(row.case, row.mesh)


def test_of_nodes_that_went_as_far_the_lowest_is_the_farthest():
    near, far, lower = (Farthest(*one, np.zeros(2)) for one in ((1.0, 4), (2.0, 7), (2.0, 3)))
    assert near.further(far) is far.further(near) is far
    assert far.further(lower) is lower.further(far) is lower
    before = np.zeros((40_000, 2))
    after = before.copy()
    after[[9, 20_000, 30_000]] = 1.0
    found = farthest_node(before, after)
    assert (found.node, found.length) == (9, pytest.approx(2.0**0.5))
    after[30_000] = 2.0
    assert farthest_node(before, after, np.arange(40_000) + 5).node == 30_005
