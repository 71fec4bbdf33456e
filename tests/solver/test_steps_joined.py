"""Every field of a step survives the joining of zones."""

from dataclasses import MISSING, fields, replace

import numpy as np

import slideviz as sv
from slideviz.mesh.margin import SafeFraction
from slideviz.rbf.layers import KeptLayers
from slideviz.rbf.problem import Relaxed
from slideviz.solver.steps import Step
from tests.solver.test_interface_motion import both, stage

OF_EACH_ZONE = {"field", "check_limits"}
"""What the step of the mesh of all zones has none of: it is used before, or made after."""


def usual(field):
    return None if field.default_factory is not MISSING else field.default


def test_every_field_of_a_step_survives_joining(tmp_path):
    mesh = sv.read(stage(tmp_path))
    *_, step = sv.deform(both(), mesh)
    found = sv.repair(mesh)
    each = [
        replace(
            step,
            mesh=part.mesh,
            condition=10.0 * k,
            node_counts={"moving": k},
            seconds={"solve": float(k)},
            messages=("late",),
            history=(k,),
            tried=(k,),
            control=np.array([k]),
            candidates=k,
            tolerance=0.1 * k,
            layers=0.2 * k,
            part=0.5,
            relaxed=Relaxed(k, 0.1 * k),
            repaired=replace(found, cells=np.array([k]), mesh=part.mesh),
            kept_layers=KeptLayers(((("BLOCK",), 0.1),), k),
            safe=SafeFraction(1.0 / k, cell=3),
        )
        for k, part in enumerate(mesh.parts, 1)
    ]
    steps = dict(enumerate(each))
    done = Step.joined(mesh, mesh, steps, steps, each[0])
    for field in fields(Step):
        empty = field.name not in OF_EACH_ZONE and getattr(done, field.name) is usual(field)
        assert not empty, f"{field.name} is lost where zones are joined"
    points = mesh.parts[1].points.start
    cells = mesh.parts[1].first_cell
    assert (done.index, done.total, done.part) == (each[0].index, each[0].total, 0.5)
    assert (done.node_counts, done.seconds) == ({"moving": 3}, {"solve": 3.0})
    assert done.warnings == ("zone 1: late", "zone 2: late")
    assert (done.history, done.tried, done.candidates) == ((1, 2), (1, 2), 3)
    assert done.control.tolist() == [1, 2 + points]
    assert (done.condition, done.tolerance, done.layers) == (20.0, 0.2, 0.4)
    assert done.relaxed == Relaxed(3, 0.2)
    assert done.repaired.cells.tolist() == [1, 2 + cells]
    assert done.kept_layers == KeptLayers(((("1:BLOCK",), 0.1), (("2:BLOCK",), 0.1)), 3)
    assert done.safe == SafeFraction(0.5, cell=3 + cells, zone=2)


def test_every_field_of_a_step_has_a_rule_for_several_zones():
    alone = [field.name for field in fields(Step) if "joined" not in field.metadata]
    assert alone == ["index", "total", "mesh", "part", "repaired"]  # which `joined` sets
