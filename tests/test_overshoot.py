"""No result grows far beyond the motion, and no system that was not solved gives one."""

import re

import numpy as np
import pytest
from builders import annulus, grid, layered, square

import slideviz as sv
from slideviz.case.model import Case, Rotate, Translate
from slideviz.case.reduction import Reduction
from slideviz.errors import UnsoundError
from slideviz.rbf import methods

# A wall moves along itself; beside it, 1e-6 away, nodes of the sliding sides stay.
SHEARED = Case(
    roles={"y_m": "moving", "x_m": "sliding", "x_p": "sliding"},
    motions=(Translate("y_m", (0.05, 0.0)),),
)


@pytest.mark.parametrize("sliding", ["none", "ps", "ds"])
def test_layers_that_cannot_follow_are_refused_with_their_nodes(sliding):
    # Before, nodes were 40 sizes of the mesh away, and only inverted cells told of it.
    mesh = layered(8, 1e-4)
    with pytest.raises(UnsoundError) as told:
        list(sv.deform(SHEARED.change(sliding=sliding), mesh))
    message = str(told.value)
    assert "whose largest displacement so far is 0.05:" in message
    words = r"would go (\S+) far, more than 5 times the (\S+) that the motion reaches"
    far, reach = map(float, re.search(words, message).groups())
    assert far > 5 * reach > 5 * 0.05  # the sheared wall carries what is beside it
    pair = r"nodes \d+ \(x_., y_m\) and \d+ \(x_.\), 7.3e-05 apart, move by 0.05 differently"
    assert re.search(pair, message)
    assert "wendland-c0" in message


@pytest.mark.parametrize("steps", [0, 3])
@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-6)])
def test_steps_and_data_reduction_do_not_hide_it(steps, reduction):
    case = SHEARED.change(sliding="ds", steps=steps, reduction=reduction)
    with pytest.raises(UnsoundError, match="that the motion reaches, whose largest displacement"):
        list(sv.deform(case, layered(8, 1e-4)))


def test_the_remedy_helps():
    *_, last = sv.deform(SHEARED.change(sliding="ds", kernel="wendland-c0"), layered(8))
    mesh = layered(8)
    assert np.abs(last.mesh.points - mesh.points).max() <= 0.05 * (1 + 1e-12)


@pytest.mark.parametrize("kernel", ["gaussian", "wendland-c4"])
def test_a_system_that_was_not_solved_is_refused(kernel):
    # The control nodes themselves are missed: setting them exactly would hide it.
    with pytest.raises(UnsoundError, match=r"misses its own control nodes by .* \(condition"):
        list(sv.deform(SHEARED.change(kernel=kernel), layered(8)))


@pytest.mark.parametrize(("factor", "spread"), [(2.5, False), (40.0, True)])
def test_what_a_badly_conditioned_system_loses_is_spread(monkeypatch, factor, spread):
    calls = []
    plain = methods.correct
    monkeypatch.setattr(methods, "correct", lambda *given: calls.append(plain(*given)))
    case = Case(roles={"BLOCK": "moving"}, motions=(Translate("BLOCK", (0.02, 0.01)),))
    mesh = square(20)
    *_, last = sv.deform(case.change(kernel="wendland-c4", influence_factor=factor), mesh)
    assert (last.max_error > 1e-9) is spread is bool(calls)
    assert sv.quality(last.mesh, mesh).inverted == 0


def test_a_profile_that_turns_takes_a_large_far_field_along():
    # The far field slides: turned with the small ring in its middle, it goes 10 times as far.
    mesh = annulus(24, 12)
    case = Case(
        roles={"wall": "moving", "far0": "sliding"},
        motions=(Rotate("wall", 5.0, point="centroid"),),
        sliding="ps",
    )
    *_, last = sv.deform(case.change(influence_factor=20.0), mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0


def test_a_body_that_turns_far_from_its_axis_is_no_overshoot():
    mesh = grid((6, 6), [(2, 4), (2, 4)])
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 20.0, point="centroid"),))
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0
    *_, last = sv.deform(case.change(motions=(Translate("BLOCK", (1e-9, 0.0)),)), square(6))
