"""Every loop that waits for an error to fall ends, and what stayed above the tolerance is told."""

import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.cli import run
from slideviz.errors import DeformError
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.rbf.level import LOSSES, LevelLimit
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import write_sample
from tests import builders

TOLD = r"step \d+: the data reduction ended with \d+ control nodes at an error of \S+, above its "


def limited(case, mesh, cycles=2000):
    """The steps, of a run that must not go on for ever."""
    turns = 0

    def tell(progress):
        nonlocal turns
        turns += progress.phase == "select"
        if turns > cycles:
            pytest.fail("the selection goes on and on")

    return list(sv.deform(case, mesh, tell))


def hexahedron(tmp_path, **settings):
    write_sample("hexahedron", tmp_path, 6)
    case = sv.Case.read(tmp_path / "hexahedron.cfg")
    return case.change(steps=1, **settings), sv.read(tmp_path / "mesh.su2")


def test_a_selection_stops_when_nothing_falls():
    rule = LevelLimit(1.0, 1e9)
    assert [rule.ends(1.0 - 0.005 * k, 1.0) for k in range(LOSSES)] == [False] * 7 + [True]
    rule = LevelLimit(1.0, 1e9)
    assert not any(rule.ends(0.98**k, 1.0) for k in range(100))


def test_a_selection_stops_when_the_budget_is_spent():
    rule = LevelLimit(1.0, 100.0)
    assert [rule.ends(0.1**k, 30.0) for k in range(4)] == [False, False, False, True]


@pytest.mark.parametrize("criterion", ["size", "tol"])
@pytest.mark.parametrize("sliding", ["none", "ps", "ds"])
def test_levels_of_a_singular_system_end_and_tell_their_error(tmp_path, sliding, criterion):
    reduction = Reduction(
        relative=1e-6, multilevel=True, criterion=criterion, level_tolerance=0.999999
    )
    case, mesh = hexahedron(tmp_path, kernel="gaussian", influence_factor=10.0, sliding=sliding)
    if sliding == "none":
        case = case.change(periodic="fixed")
    (step,) = limited(case.change(reduction=reduction), mesh)
    (told,) = [text for text in step.warnings if re.match(TOLD + "tolerance of 1e-06: ", text)]
    assert f"at an error of {step.max_error:.3g}" in told
    assert "use a smaller INFLUENCE_FACTOR, RBF_KERNEL= wendland-c2, or a larger" in told
    assert not any("does no harm" in text for text in step.warnings)


def test_levels_too_small_to_lower_the_error_are_given_up_and_the_tolerance_is_met():
    mesh = builders.cube(6)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    case = Case(
        roles=roles,
        motions=(Translate("BLOCK", (0.1, 0.05, 0.1)),),
        sliding="ps",
        kernel="ctps-c2b",
        reduction=Reduction(relative=1e-5, multilevel=True, level_size=2, selection="double"),
    )
    (step,) = limited(case, mesh)
    assert step.history[-1].error <= 1e-5 * mesh.extent
    assert step.warnings == ()


def twice(mesh, shift):
    """The mesh and, as other cells, the same once more beside it; its markers end in _2."""
    n = len(mesh.points)

    def moved(cells):
        return Cells.from_types(cells.types, cells.connectivity + n)

    parts = [mesh.cells, moved(mesh.cells)]
    cells = Cells.from_types(
        np.concatenate([part.types for part in parts]),
        np.concatenate([part.connectivity for part in parts]),
    )
    second = tuple(Marker(f"{m.name}_2", moved(m.cells)) for m in mesh.markers)
    return Mesh(np.concatenate([mesh.points, mesh.points + shift]), cells, mesh.markers + second)


def test_nodes_a_period_apart_that_contradict_each_other_are_refused():
    """They are one node for the periodic distance: no selection could ever meet both."""
    mesh = twice(builders.square(6), (0.0, 1.0))
    case = Case(
        roles={"y_m": "periodic", "y_p": "periodic", "BLOCK_2": "moving"},
        motions=(Translate("BLOCK_2", (0.02, 0.01)),),
        periodic="periodic",
        reduction=Reduction(relative=1e-4, multilevel=True),
    )
    with pytest.raises(DeformError, match=r"coincide .* asked to move differently, by 0\.02"):
        limited(case, mesh)


def test_a_limited_number_of_nodes_is_told_once_with_the_largest_error(tmp_path):
    case, mesh = hexahedron(tmp_path, reduction=Reduction(tolerance=1e-9, max_nodes=17))
    steps = limited(case.change(steps=3), mesh)
    worst = max(steps, key=lambda step: step.max_error)
    (told,) = steps[-1].warnings
    assert re.match(TOLD + "tolerance of 1e-09: MAX_CONTROL_NODES= 17 are chosen; allow", told)
    assert told.startswith(f"step {worst.index}: ")
    assert f"an error of {worst.max_error:.3g}, " in told


def test_what_fails_goes_back_to_its_lowest_error(tmp_path):
    reduction = Reduction(relative=1e-6, multilevel=True)
    case, mesh = hexahedron(tmp_path, kernel="gaussian", influence_factor=10.0, sliding="none")
    case = case.change(periodic="fixed", reduction=reduction)
    (step,) = limited(case, mesh)
    assert step.history[-1].error <= 2.0 * min(cycle.error for cycle in step.history)
    assert step.history[-1].control_nodes == step.control_nodes


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({}, "is 0.001, not below the largest displacement, 0.0006: no control node"),
        ({}, r"use DATA_RED_TOLERANCE= 6e-06 or less (or DATA_RED_RELATIVE= 6e-06\), a hundredth"),
        ({"relative": 2e-3}, "is 0.002, not below .*; use DATA_RED_RELATIVE= 6e-06 "),
        ({"tolerance": 1e-4}, "is 0.0001, more than a tenth of the largest displacement, 0.0006"),
        ({"tolerance": 5e-5}, None),
        (None, None),
    ],
)
def test_a_tolerance_above_the_motion_is_told(settings, said):
    mesh = builders.square(8)
    case = Case(
        roles={"BLOCK": "moving"},
        motions=(Translate("BLOCK", (0.0006, 0.0)),),
        reduction=None if settings is None else Reduction(**settings),
    )
    *_, last = sv.deform(case, mesh)
    if said is None:
        assert last.warnings == ()
        return
    (told,) = last.warnings
    assert re.search(said.replace("(", r"\("), told)
    still = case.change(motions=(Translate("BLOCK", (0.0, 0.0)),))
    *_, last = sv.deform(still, mesh)
    assert last.warnings == ()


def test_the_command_line_tells_of_a_tolerance_above_the_motion(tmp_path, capsys):

    mesh = builders.square(8)
    sv.write(tmp_path / "mesh.su2", mesh)
    (tmp_path / "a.cfg").write_text(
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nMARKER_MOVING= ( BLOCK )\n"
        "MOTION= (BLOCK, translate, 0.0006, 0.0)\nDATA_REDUCTION= YES\n"
    )
    run(["run", str(tmp_path / "a.cfg"), "--json", str(tmp_path / "report.json")])
    told = "the tolerance of the data reduction is 0.001, not below the largest displacement"
    assert f"slideviz: warning: {told}" in capsys.readouterr().err
    assert told in (tmp_path / "report.json").read_text()
