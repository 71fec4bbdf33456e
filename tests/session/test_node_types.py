"""Which nodes are drawn as points: what they may do, and the control nodes."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.case.motions.rigid import Translate
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import sample
from slideviz.session import changes
from slideviz.session.node_types import NOTHING, typed_nodes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from slideviz.solver.deform import deform
from slideviz.terms import NODE_TYPES


def session_of(one, **view):
    session = open_mesh(StepFrame(one.mesh, quality(one.mesh)), None, (), one.case)
    return changes.set_view(session, **view)


def named(typed):
    """Return the nodes of each type."""
    words = list(NODE_TYPES)
    return {kind: set(typed.nodes[typed.kinds == words.index(kind)].tolist()) for kind in words}


@pytest.fixture(scope="module")
def stator():
    return sample("stator", size=5000)


def test_nodes_of_a_solid_mesh_have_the_types_that_the_method_gives_them(stator):
    session = session_of(stator, points="types")
    found = named(typed_nodes(session))
    case = stator.case.change(motions=(Translate("BLADE", (1e-4, 0.0, 0.0)),))
    step = next(deform(case, stator.mesh))
    for kind in ("moving", "fixed", "sliding_edge", "sliding_surface"):
        assert len(found[kind]) == step.node_counts[kind], kind
    mesh = stator.mesh
    assert found["moving"] == set(mesh.marker("BLADE").nodes.tolist())
    on_hub = set(mesh.marker("HUB").nodes.tolist())
    assert found["internal"] <= on_hub | set(mesh.marker("SHROUD").nodes.tolist())
    assert found["internal"]
    every = set(np.concatenate([marker.nodes for marker in mesh.markers]).tolist())
    assert set().union(*found.values()) == every
    assert not found["control"]


def test_types_follow_the_roles_and_those_of_steps_stay_as_they_ran(passage):
    session = session_of(passage, points="types")
    walls = [name for name in passage.mesh.marker_names if session.role(name) == "sliding"]
    before = named(typed_nodes(session))
    assert before["sliding_edge"]
    fixed = changes.set_role(session, walls, "fixed")
    assert len(named(typed_nodes(fixed))["sliding_edge"]) < len(before["sliding_edge"])
    step = next(deform(session.case, passage.mesh))
    ran = changes.add_frames(
        changes.start_run(session), [StepFrame(step.mesh, quality(step.mesh), step)]
    )
    changed = changes.set_role(ran, walls, "fixed")
    assert named(typed_nodes(changed)) == before
    assert named(typed_nodes(changes.show_frame(changed, 0))) == named(typed_nodes(fixed))


def test_types_are_worked_out_once_for_a_case(passage, monkeypatch):
    from slideviz.session import node_types as module

    asked, real = [], module.find_classes

    def counted(*values):
        asked.append(1)
        return real(*values)

    monkeypatch.setattr(module, "find_classes", counted)
    fresh = replace(passage, mesh=replace(passage.mesh, name="fresh"))
    session = session_of(fresh, points="types")
    first = typed_nodes(session)
    assert typed_nodes(changes.set_view(session, edges=False)) is first
    assert typed_nodes(changes.set_case(session, steps=7)) is first
    assert len(asked) == 1
    typed_nodes(changes.set_case(session, sliding="none", periodic="none"))
    assert len(asked) == 2


def test_control_nodes_are_those_that_the_step_interpolated_with(passage):
    case = passage.case.change(reduction=Reduction(tolerance=1e-2), steps=2)
    session = changes.start_run(session_of(passage, points="control"))
    assert typed_nodes(session) is NOTHING
    steps = list(deform(case, passage.mesh))
    session = changes.add_frames(
        session, [StepFrame(step.mesh, quality(step.mesh), step) for step in steps]
    )
    boundary = np.unique(np.concatenate([marker.nodes for marker in passage.mesh.markers]))
    for index, step in enumerate(steps, start=1):
        found = named(typed_nodes(changes.show_frame(session, index)))["control"]
        assert found == set(step.control.tolist())
        assert len(found) == step.control_nodes < len(boundary)
        assert found <= set(boundary.tolist())
    # With all nodes as control nodes, every one whose displacement is known is among them.
    step = next(deform(case.change(reduction=None), passage.mesh))
    assert len(step.control) == step.control_nodes > len(found)
    assert set(step.control.tolist()) <= set(boundary.tolist())


def test_a_mesh_without_boundaries_and_a_case_with_mistakes_have_no_types(passage):
    session = session_of(passage, points="types")
    bare = replace(session, mesh=replace(passage.mesh, markers=()))
    assert not len(typed_nodes(bare).nodes)
    assert typed_nodes(changes.set_view(session, points="none")) is NOTHING


def test_the_boundary_is_found_once_for_a_mesh(passage, monkeypatch):
    from slideviz.mesh import topology

    mesh, found = replace(passage.mesh, name="another"), []
    real = topology._find_owners
    counted = lambda m, *args: found.append(m) or real(m, *args)  # noqa: E731
    monkeypatch.setattr(topology, "_find_owners", counted)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, (), passage.case)
    find_surfaces(mesh)
    typed_nodes(changes.set_view(session, points="types"))
    for _ in range(2):
        next(deform(passage.case, mesh))
    assert found == [mesh]
