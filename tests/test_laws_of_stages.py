"""The laws of relaxation, repair, streaming, units, samples and machines notice what is wrong."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import slideviz as sv
from slideviz.solver.deform import deform
from tests import builders
from tools.laws import machines, stages
from tools.laws.__main__ import of_seed
from tools.laws.cases import random_run
from tools.laws.laws import HELD, again
from tools.laws.sampling import smallest_jacobians


@pytest.fixture(scope="module")
def run():
    return random_run(7)


@pytest.fixture(scope="module")
def steps(run):
    return list(deform(run.case, run.mesh))


def spoilt(steps, mesh):
    return [*steps[:-1], replace(steps[-1], mesh=mesh)]


@pytest.mark.parametrize("mesh", [builders.square(6, "mixed"), builders.cube(4, "mixed")])
def test_sampled_jacobians_are_volumes_in_the_mean(mesh):
    least, mean = smallest_jacobians(mesh, np.random.default_rng(0), 4000)
    assert (least > 0).all()
    size = {5: 2.0, 9: 1.0, 10: 6.0, 12: 1.0, 13: 2.0, 14: 3.0}
    total = sum(mean[cells].sum() / size[vtk] for vtk, (cells, _) in mesh.cells.by_type.items())
    hole = (2 / 6) ** 2 if mesh.dim == 2 else (2 / 4) ** 3
    assert total == pytest.approx(1.0 - hole, rel=0.02)


def test_a_folded_cell_that_is_called_valid_is_noticed(run, steps, monkeypatch):
    assert list(stages.validity_is_that_of_samples(run, steps)) == []
    points = np.array(steps[-1].mesh.points)
    inner = np.setdiff1d(
        np.arange(len(points)), np.concatenate([m.nodes for m in run.mesh.markers])
    )
    points[inner[0]] += 0.5 * run.mesh.extent
    folded = steps[-1].mesh.with_points(points)
    valid = sv.quality(run.mesh)
    monkeypatch.setattr(stages, "quality", lambda *_: valid)
    assert list(stages.validity_is_that_of_samples(run, spoilt(steps, folded)))


def test_a_result_that_depends_on_the_unit_is_noticed(run, steps):
    law = stages.unit_does_not_matter(again, 1e-7)
    assert list(law(run, steps)) == []
    other = steps[-1].mesh.with_points(steps[-1].mesh.points + 1e-5 * run.mesh.extent)
    assert list(law(run, spoilt(steps, other)))


@pytest.mark.parametrize("make", [stages.relaxed_is_held, stages.repaired_is_held])
def test_stages_that_move_held_nodes_are_noticed(make):
    run = next(r for r in map(random_run, range(30)) if relaxes(r))
    steps, _ = again(run.case, run.mesh)
    assert list(make(again, HELD)(run, steps)) == []

    def moved(case, mesh):
        done, problem = again(case, mesh)
        other = done[-1].mesh.with_points(done[-1].mesh.points + 1e-6 * mesh.extent)
        return spoilt(done, other), problem

    assert list(make(moved, HELD)(run, steps))


def relaxes(run):
    return run.case.method == "rbf" and again(run.case.change(relax="yes"), run.mesh)[0] is not None


def test_other_bits_of_a_streamed_run_are_noticed(steps):
    run = next(r for r in map(random_run, range(20)) if streams(r))

    def moved(case, mesh):
        done, problem = again(case, mesh)
        return spoilt(done, done[-1].mesh.with_points(done[-1].mesh.points * (1 + 1e-15))), problem

    assert list(stages.streamed_is_the_same(again)(run, steps)) == []
    assert list(stages.streamed_is_the_same(moved)(run, steps))


def streams(run):
    asked = []
    law = stages.streamed_is_the_same(lambda *_: (asked.append(1), ([], None))[1])
    try:
        list(law(run, []))
    except IndexError:
        return True
    return bool(asked)


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_a_safe_fraction_that_is_wrong_is_noticed(run, monkeypatch, factor):
    mesh = builders.square(6)
    points = np.array(mesh.points)
    inner = np.setdiff1d(np.arange(len(points)), np.concatenate([m.nodes for m in mesh.markers]))
    points[inner[0]] += [0.0, 0.05]
    moved = mesh.with_points(points)
    other, last = replace(run, made=replace(run.made, mesh=mesh)), [SimpleNamespace(mesh=moved)]
    assert list(stages.safe_fraction_is_safe(other, last)) == []
    found = sv.safe_fraction(moved, mesh)
    wrong = replace(found, fraction=factor * found.fraction)
    monkeypatch.setattr(sv, "safe_fraction", lambda *_: wrong)
    assert len(list(stages.safe_fraction_is_safe(other, last))) == 1


@pytest.mark.parametrize("name", machines.LAWS)
def test_no_law_of_machines_is_broken(name):
    for seed in range(3):
        assert list(machines.LAWS[name](np.random.default_rng([seed, 5]))) == []


@pytest.mark.parametrize("name", machines.LAWS)
def test_laws_of_machines_notice_nodes_that_are_off(name, monkeypatch):
    def off(case, mesh):
        *_, last = deform(case, mesh)
        return last.mesh.with_points(last.mesh.points * np.linspace(1.0, 1.01, mesh.dim))

    monkeypatch.setattr(machines, "_last", off)
    found = list(machines.LAWS[name](np.random.default_rng([1, 5])))
    assert bool(found) is (name not in ("zones",))


def test_a_seed_in_so_many_has_a_machine(monkeypatch):
    monkeypatch.setattr(machines, "broken", lambda seed: [("wheel", f"of {seed}")])
    assert of_seed(8).broken[-1] == ("wheel", "of 8")
    assert of_seed(7).broken == ()


def test_a_machine_that_ends_with_an_error_is_a_violation(monkeypatch):
    def fails(rng):
        raise ZeroDivisionError("no")

    monkeypatch.setattr(machines, "LAWS", {"wheel": fails})
    assert list(machines.broken(1)) == [("wheel", "it ends with ZeroDivisionError('no')")]
