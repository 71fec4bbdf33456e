"""STEPS= auto: as few steps as are enough, folding steps halved, and what is told about folds."""

import json
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.motions.rigid import Translate
from slideviz.cli import run
from slideviz.mesh.quality import INVERTED
from slideviz.samples.table import sample, write_sample
from slideviz.solver.deform import COUNTS, all_steps, folded_at


@pytest.fixture
def square():
    found = sample("square", 25, "motion")
    return found.mesh, found.case.change(steps=0, periodic="periodic")


@pytest.mark.parametrize("sliding", ["none", "ps", "ds"])
def test_it_stops_when_more_steps_gain_little(square, sliding):
    mesh, case = square
    *_, last = sv.deform(case.change(sliding=sliding), mesh)
    tried = {trial.planned: trial for trial in last.tried}
    assert last.index == last.total
    chosen = next(trial for trial in tried.values() if trial.steps == last.total)
    assert chosen.inverted == 0
    assert chosen.min == sv.quality(last.mesh, mesh).min
    later = [trial for trial in tried.values() if trial.planned > chosen.planned]
    if later:
        assert len(later) == (1 if chosen.steps == chosen.planned else 2)
        assert later[0].min <= chosen.min * (1 + case.steps_gain)
    else:
        assert chosen.planned == COUNTS[-1]
    earlier = [trial for trial in tried.values() if trial.planned < chosen.planned]
    assert all(t.inverted or t.min * (1 + case.steps_gain) < chosen.min for t in earlier)


def test_a_larger_gain_takes_fewer_steps(square):
    mesh, case = square
    *_, fine = sv.deform(case.change(steps_gain=0.001), mesh)
    *_, coarse = sv.deform(case.change(steps_gain=0.5), mesh)
    assert coarse.total < fine.total


def test_the_result_is_that_of_so_many_steps(square):
    mesh, case = square
    *_, last = sv.deform(case, mesh)
    chosen = next(trial for trial in last.tried if trial.steps == last.total)
    assert chosen.planned == chosen.steps
    *_, same = sv.deform(case.change(steps=last.total), mesh)
    assert np.array_equal(same.mesh.points, last.mesh.points)


def test_a_folding_step_is_halved(square):
    mesh, case = square
    case = case.change(steps=0, steps_gain=0.99, periodic="none", sliding="ps")
    *_, once = sv.deform(case.change(steps=1), mesh)
    assert sv.quality(once.mesh, mesh).inverted > 0
    steps = list(sv.deform(case, mesh))
    first = steps[-1].tried[0]
    assert first.planned == 1
    assert first.steps > 1
    assert [step.index for step in steps] == list(range(1, len(steps) + 1))
    assert {step.total for step in steps} == {len(steps)}
    assert all(sv.quality(step.mesh, mesh).inverted == 0 for step in steps)


class Recorded:
    """A run of which is known what each number of steps gives: steps made, and minimum quality."""

    setup = SimpleNamespace(relaxation=None)

    def __init__(self, given):
        self.case, self.given = sv.Case(steps=0), given

    def steps(self, count, halve):
        assert halve
        steps, least, *inverted = self.given[count]
        return [Made(least, inverted=sum(inverted))] * steps

    def quality_of(self, steps):
        return steps[-1]


@dataclass(frozen=True)
class Made:
    min: float
    mean: float = 0.5
    inverted: int = 0
    total: int = 0
    tried: tuple = ()


def test_one_worse_number_does_not_end_the_search_where_steps_were_halved():
    better_later = {1: (4, 0.078), 5: (5, 0.072), 8: (8, 0.088), 13: (13, 0.095), 21: (21, 0.0951)}
    found = list(all_steps(Recorded(better_later)))
    assert len(found) == 13
    assert [trial.planned for trial in found[-1].tried] == [1, 5, 8, 13, 21]
    worse_twice = {1: (4, 0.078), 5: (5, 0.072), 8: (8, 0.073)}
    assert len(list(all_steps(Recorded(worse_twice)))) == 4


def test_one_worse_number_ends_the_search_where_none_was_halved():
    found = list(all_steps(Recorded({1: (1, 0.078), 2: (2, 0.072)})))
    assert len(found) == 1


def test_a_number_that_folds_cells_after_one_that_does_not_ends_the_search_only_twice():
    """Turned by 60 degrees, the search ended with the first number, of minimum quality 0.011."""
    found = list(all_steps(Recorded({1: (1, 0.011), 2: (2, 0.0, 3), 3: (3, 0.2), 5: (5, 0.201)})))
    assert len(found) == 3
    assert len(list(all_steps(Recorded({1: (1, 0.011), 2: (2, 0, 3), 3: (3, 0, 1)})))) == 1


def test_a_hopeless_case_gives_the_least_folded(square):
    mesh, case = square
    block = (Translate("BLOCK", (0.0, -0.4749)),)
    case = case.change(motions=block, sliding="none", periodic="none")
    *_, last = sv.deform(case, mesh)
    found = sv.quality(last.mesh, mesh).inverted
    assert found == min(trial.inverted for trial in last.tried)


def test_folded_at_names_the_first_step():
    found = sample("square", 25, "motion")
    case = found.case.change(
        steps=4, sliding="none", periodic="none", motions=(Translate("BLOCK", (-0.35, -0.43)),)
    )
    steps = list(sv.deform(case, found.mesh))
    status = np.stack([sv.quality(s.mesh, found.mesh).status == INVERTED for s in steps])
    ever = np.flatnonzero(status.any(axis=0))
    assert len(ever) > 3
    expected = status[:, ever].argmax(axis=0) + 1
    assert np.array_equal(folded_at(steps, found.mesh, ever), expected)
    whole = np.flatnonzero(~status.any(axis=0))[:5]
    assert np.array_equal(folded_at(steps, found.mesh, whole), np.zeros(5))
    assert folded_at(steps, found.mesh, np.empty(0, np.int64)).shape == (0,)


def test_the_report_has_trials_and_folds(tmp_path, capsys):
    write_sample("square", tmp_path, 25)
    case = str(tmp_path / "square.cfg")
    assert run(["run", case, "--set", "STEPS=auto", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["tried"][0]["planned"] == 1
    assert report["steps"] in [trial["steps"] for trial in report["tried"]]
    argv = ["run", case, "--set", "STEPS=1", "--set", "SLIDING_MODE=none", "--json", "-"]
    assert run([*argv, "--set", "PERIODIC_MODE=none"]) == 3
    out = capsys.readouterr()
    report = json.loads(out.out)
    assert set(report["quality"]["inverted_at_step"]) == {1}
    assert "step 1" in out.err
    assert "STEPS= auto" in out.err
    assert "SLIDING_MODE= ps or ds" in out.err


def test_auto_is_read_and_written(tmp_path):
    write_sample("square", tmp_path, 9)
    case = sv.Case.read(tmp_path / "square.cfg").change(steps=0, steps_gain=0.1)
    case.write(tmp_path / "auto.cfg")
    assert "STEPS= auto" in (tmp_path / "auto.cfg").read_text()
    again = sv.Case.read(tmp_path / "auto.cfg")
    assert (again.steps, again.steps_gain) == (0, 0.1)
    (tmp_path / "bad.cfg").write_text("STEPS= 0\n")
    with pytest.raises(sv.SlidevizError, match="whole number from 1 to 9999, or auto"):
        sv.Case.read(tmp_path / "bad.cfg")


def test_the_summary_says_that_the_number_was_found_and_what_was_tried(tmp_path, capsys):
    write_sample("square", tmp_path, 9)
    words = ["run", str(tmp_path / "square.cfg"), "-o", str(tmp_path / "out.su2"), "--steps"]
    run([*words, "auto", "--set", "SLIDING_MODE=none", "--set", "PERIODIC_MODE=none"])
    out = capsys.readouterr().out
    assert " (AUTO), sliding none" in out.splitlines()[0]
    (line,) = [line for line in out.splitlines() if line.startswith("  steps tried: 1 (")]
    assert "halved to" in line or "inverted" in line
    run([*words, "2"])
    out = capsys.readouterr().out
    assert "AUTO)," not in out
    assert "tried" not in out
