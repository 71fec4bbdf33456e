"""Random meshes and cases of ``tools.laws``: no law of deformation is broken."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.errors import DeformError
from slideviz.formats.files import read
from slideviz.solver.deform import deform
from tools.laws import laws
from tools.laws.__main__ import main, of_seed, save
from tools.laws.cases import random_run
from tools.laws.check import check
from tools.laws.meshes import images
from tools.laws.oracle import nodes_with

SLIDES, REPEATS = 7, 30
"""Seeds of runs with sliding, fixed and periodic boundaries."""

SMALL, SMALL_BODIES = 76, (9, 76, 101, 329, 597, 714, 888)
"""Seeds of runs with small bodies in wide far fields, with many methods and kernels."""


@pytest.mark.parametrize(
    "first",
    [*range(0, 27, 9), *(pytest.param(first, marks=pytest.mark.slow) for first in (27, 36))],
)
def test_no_law_is_broken(first):
    found = [of_seed(seed) for seed in range(first, first + 9)]
    assert [(one.seed, one.broken) for one in found if one.broken] == []
    assert any(one.ended == "done" for one in found)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(10_000, 10_400, 50))
def test_no_law_is_broken_by_many_more_runs(first):
    found = [of_seed(seed) for seed in range(first, first + 50)]
    assert [(one.seed, one.broken) for one in found if one.broken] == []


def test_a_seed_gives_the_same_run_each_time(tmp_path):
    run, again = random_run(7), random_run(7)
    assert run.case == again.case
    assert run.mesh.points.tobytes() == again.mesh.points.tobytes()
    case = save(7, tmp_path)
    assert read(tmp_path / "7.su2").points.tobytes() == run.mesh.points.tobytes()
    assert type(run.case).read(case).motions == run.case.motions


def spoilt(monkeypatch, seed, change):
    """What the laws say of a run whose last step is changed by ``change(run, points)``."""
    run = random_run(seed)

    def spoil(case, mesh):
        *before, last = deform(case, mesh)
        points = np.array(last.mesh.points)
        change(run, points)
        return [*before, replace(last, mesh=last.mesh.with_points(points))]

    monkeypatch.setattr(laws, "deform", spoil)
    return {law for law, _ in check(run).broken}


def nudge(role, part=1e-8):
    def change(run, points):
        nodes = nodes_with(run.case, run.mesh, role)
        if role == "sliding":
            nodes = np.setdiff1d(nodes, nodes_with(run.case, run.mesh, "moving", "fixed"))
        points[nodes] += part * run.mesh.extent

    return change


@pytest.mark.parametrize("law", ["moving", "fixed", "sliding"])
def test_a_law_sees_nodes_that_are_off(law, monkeypatch):
    assert law in spoilt(monkeypatch, SLIDES, nudge(law))


def test_growth_sees_a_node_that_goes_too_far(monkeypatch):
    def far(run, points):
        points[-1] += run.mesh.extent

    assert "growth" in spoilt(monkeypatch, SLIDES, far)


def test_reach_sees_a_node_that_moves_out_of_reach(monkeypatch):
    def nudged(run, points):
        points[np.argmax(np.linalg.norm(points, axis=1))] *= 1.0 + 1e-12

    run = random_run(SMALL)
    assert {"body"} < {*run.mesh.marker_names}
    assert run.case.polynomial == "auto"  # a linear polynomial has no reach
    assert "reach" in spoilt(monkeypatch, SMALL, nudged)


@pytest.mark.parametrize("seed", SMALL_BODIES)
def test_no_law_is_broken_by_small_bodies(seed):
    found = of_seed(seed)
    assert (found.ended, found.broken) == ("done", ())


def test_numbering_may_change_no_more_than_a_run_says_itself():
    run = random_run(30634)
    steps = list(deform(run.case, run.mesh))
    assert 1e-9 < laws.doubt(run.mesh, steps) < 1e-3
    assert list(laws.numbering_does_not_matter(run, steps)) == []
    plain = random_run(SLIDES)
    assert laws.doubt(plain.mesh, list(deform(plain.case, plain.mesh))) == 0.0


def test_a_run_whose_nodes_coincide_after_a_step_says_that_it_may_be_all_wrong():
    run = random_run(10165)
    steps = list(deform(run.case, run.mesh))
    assert any("may be wrong by up to 100 % of the largest" in text for text in steps[-1].warnings)
    assert list(laws.numbering_does_not_matter(run, steps)) == []


def test_images_see_one_that_goes_another_way(monkeypatch):
    def apart(run, points):
        a, _ = images(run.made, run.period)[0]
        points[a] += 1e-10 * run.mesh.extent

    assert "images" in spoilt(monkeypatch, REPEATS, apart)


def test_an_error_of_the_program_is_a_violation(monkeypatch, capsys):
    def broken(case, mesh):
        raise ZeroDivisionError("no")

    monkeypatch.setattr(laws, "deform", broken)
    assert main(["--runs", "1"]) == 1
    assert "ending: ZeroDivisionError" in capsys.readouterr().out


def test_a_refusal_must_have_a_known_reason(monkeypatch):
    def refused(case, mesh):
        raise DeformError("out of luck at 0.125")

    monkeypatch.setattr(laws, "deform", refused)
    outcome = of_seed(0)
    assert outcome.ended == "refused: out of luck at #"
    assert [law for law, _ in outcome.broken] == ["refusal"]


def test_a_run_that_does_not_end_is_a_violation(monkeypatch):
    def forever(case, mesh):
        while True:
            pass

    monkeypatch.setattr(laws, "deform", forever)
    monkeypatch.setattr(laws, "LIMIT_S", 0.2)
    [(law, text)] = of_seed(0).broken
    assert law == "ending"
    assert "TooLong" in text
