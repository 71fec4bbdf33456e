"""No result grows far beyond the motion, and no system that was not solved gives one."""

import re

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.errors import UnsoundError
from slideviz.rbf import methods
from slideviz.rbf.reduction import Reduction
from slideviz.solver.growth import Farthest, _cause, stray_warning
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from slideviz.streaming import run as streamed_run
from slideviz.streaming.run import stream
from tests.builders import annulus, far_field, grid, layered, square

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
    words = r"would move by (\S+), more than 5 times the (\S+) that the motion reaches"
    far, reach = map(float, re.search(words, message).groups())
    assert far > 5 * reach > 5 * 0.05  # the sheared wall carries what is beside it
    pair = r"nodes \d+ \(x_., y_m\) and \d+ \(x_.\), 7.3e-05 apart, have displacements that "
    pair += "differ by 0.05"
    assert re.search(pair, message)
    assert "wendland-c0" in message


@pytest.mark.parametrize("steps", [0, 3])
@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-6)])
def test_steps_and_data_reduction_do_not_hide_it(steps, reduction):
    case = SHEARED.change(sliding="ds", steps=steps, reduction=reduction)
    with pytest.raises(UnsoundError, match="that the motion reaches, whose largest displacement"):
        list(sv.deform(case, layered(8, 1e-4)))


def set_already(case, text):
    """The remedies in a message that a case has."""
    remedies = re.findall(r"([A-Z_]+)= ([\w-]+)", text.rpartition("; ")[2])
    values = {key: KEYS[key].kind.write(KEYS[key].get(case)) for key, _ in remedies}
    named = [key for key, value in remedies if values[key].lower() == value.lower()]
    return named + (["RBF_KERNEL"] if f"such as {case.kernel}" in text else [])


@pytest.mark.parametrize("kernel", ["wendland-c0", "wendland-c2", "gaussian"])
@pytest.mark.parametrize("reduction", [None, Reduction(), Reduction(auto=True)])
@pytest.mark.parametrize("role", ["moving", "fixed", "sliding"])
def test_no_remedy_is_set_already(kernel, reduction, role, monkeypatch):
    case = Case(
        roles={"y_m": "moving", "x_m": role},
        motions=(Translate("y_m", (0.05, 0.0)), Translate("x_m", (0.05, 0.0))),
        kernel=kernel,
        reduction=reduction,
        sliding="ps",
        influence_factor=2.5,
    )
    mesh = layered(8, 1e-4)
    setup = make_setup(prepare(case.change(motions=case.motions[: 1 + (role == "moving")]), mesh))
    for steep in (0.0, 1e9):
        monkeypatch.setattr("slideviz.solver.growth.STEEP", steep)
        for node, gap in ((0, 1.0), (8, 0.5)):
            moved = setup.coords.copy()
            moved[setup.known[node]] += gap
            said = _cause(setup, mesh, moved)
            assert not set_already(case, said)
            pair = [int(each) for each in re.findall(r"(?:nodes|and) (\d+) \(", said)]
            fixed = np.isin(pair, setup.classes.fixed).any()
            assert ("make the fixed boundary" in said) == fixed
    far = Farthest(9.0, 0, mesh.points[0])
    after = mesh.points.copy()
    after[setup.known] += 1e-3
    monkeypatch.setattr("slideviz.solver.growth.STRAY", 3.0)
    (said,) = stray_warning(setup, mesh, after, far)
    assert not set_already(case, said)


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


def stretched(folder, **settings):
    """A case whose block is stretched across, in a far field sixty times as wide, and its mesh."""
    sv.write(folder / "mesh.su2b", far_field(60.0))
    motion = sv.Scale("body", (1.0, 1.2))
    roles = {"body": "moving", "far": "fixed"}
    file = folder / "mesh.su2b"
    return sv.Case(roles=roles, motions=(motion,), mesh_file=file, **settings), sv.read(file)


def test_nodes_that_stray_are_named_with_the_remedy(tmp_path, monkeypatch):
    case, mesh = stretched(tmp_path, influence_factor=2.5)
    *_, last = sv.deform(case, mesh)
    length = np.linalg.norm(last.mesh.points - mesh.points, axis=1)
    (said,) = last.warnings
    node = int(said.split()[1])
    # The mesh is symmetric: rounding decides which of the two farthest nodes is named.
    assert length[node] == pytest.approx(length.max(), rel=1e-6)
    assert length[node] > 10 * length[mesh.marker("body").nodes].max()
    where = ", ".join(f"{x:g}" for x in mesh.points[node])
    assert said.startswith(f"node {node} at ({where}) moves by {length[node]:.3g}, 20.3 times")
    assert "INFLUENCE_FACTOR= AUTO, or RBF_KERNEL= wendland-c0" in said
    for better in ({"influence_factor": "auto"}, {"kernel": "wendland-c0"}):
        assert [*sv.deform(case.change(**better), mesh)][-1].warnings == ()
    # A radius that is small already is to be smaller yet.
    monkeypatch.setattr("slideviz.solver.growth.STRAY", 3.0)
    (small,) = [*sv.deform(case.change(influence_factor="auto"), mesh)][-1].warnings
    factor = float(small.split("INFLUENCE_FACTOR= ")[1].split(",")[0])
    assert [*sv.deform(case.change(influence_factor=factor), mesh)][-1].warnings == ()
    monkeypatch.undo()
    # A streamed run says the same, of nodes that are not in its skin.
    monkeypatch.setattr(streamed_run, "CHUNK", 50)
    done = stream(case, tmp_path / "out.su2b")
    assert node not in done.mesh.numbering.points
    assert done.steps[-1].warnings == (said,)
