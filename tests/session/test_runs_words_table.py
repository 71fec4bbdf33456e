"""The runs in words and as a table."""

import csv
import io
from dataclasses import replace

import pytest

from slideviz.case.motion_words import describe
from slideviz.case.motions.rigid import Rotate
from slideviz.errors import SlidevizError
from slideviz.mesh.quality import quality
from slideviz.rbf.reduction import Reduction
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.runs_words import (
    COLUMNS,
    best_runs,
    describe_run,
    method_words,
    reduction_words,
    seconds_words,
    steps_words,
    summary,
    table_rows,
)
from slideviz.session.state import Run, StepFrame
from slideviz.solver.deform import deform
from slideviz.system.csv_table import csv_text, write_csv


@pytest.fixture(scope="module")
def runs(passage):
    """Two runs: pseudo sliding in two steps, and direct sliding in one with chosen nodes."""
    first = passage.case.change(sliding="ps", periodic="moving", steps=2)
    second = passage.case.change(
        sliding="ds", periodic="fixed", steps=1, reduction=Reduction(tolerance=1e-2)
    )
    session = open_mesh(StepFrame(passage.mesh, quality(passage.mesh)), None, (), first)
    for case in (first, second):
        session = changes.start_run(changes.set_case(session, **_settings(case)))
        for step in deform(case, passage.mesh):
            frame = StepFrame(step.mesh, quality(step.mesh, passage.mesh), step)
            session = changes.add_frames(session, [frame])
        session = changes.end_run(session, "done")
    return session.runs


def _settings(case):
    names = ("sliding", "periodic", "steps", "reduction")
    return {name: getattr(case, name) for name in names}


def table_text(runs, delimiter=","):
    return csv_text(table_rows(runs), delimiter)


def rows(text, delimiter=","):
    return list(csv.DictReader(io.StringIO(text), delimiter=delimiter))


def test_the_table_has_settings_and_results_of_every_run(runs):
    found = rows(table_text(runs))
    assert [row["run"] for row in found] == ["1", "2"]
    assert [row["method"] for row in found] == ["pseudo sliding", "direct sliding"]
    assert {row["motion"] for row in found} == {"; ".join(map(describe, runs[0].case.motions))}
    assert [row["steps"] for row in found] == ["2", "1"]
    assert found[1]["control nodes chosen"] == "reduced to 0.01"
    for row, run in zip(found, runs, strict=True):
        assert float(row["minimum quality"]) == run.last.quality.min, "every digit is there"
        assert float(row["periodic misfit"]) < 1e-14
        assert float(row["mean quality"]) == run.last.quality.mean
        assert int(row["inverted cells"]) == run.last.quality.inverted
        assert int(row["control nodes"]) == run.last.step.control_nodes
        assert float(row["seconds"]) == run.seconds
        assert row["end"] == "done"
    assert rows(table_text(runs, "\t"), "\t") == found


def test_the_table_is_written_whole_or_not_at_all(runs, tmp_path):
    write_csv(tmp_path / "runs.csv", table_rows(runs))
    assert (tmp_path / "runs.csv").read_text() == table_text(runs)
    with pytest.raises(SlidevizError, match="the folder does not exist"):
        write_csv(tmp_path / "nowhere" / "runs.csv", table_rows(runs))


def test_a_run_is_described_in_a_line_and_in_full(runs):
    first, second = runs
    nodes = [run.last.step.control_nodes for run in runs]
    assert summary(first).startswith(f"moving vertices · 2 steps · {nodes[0]} nodes · ")
    assert summary(second).startswith(f"fixed vertices · 1 step · {nodes[1]} nodes · ")
    other = replace(second, case=second.case.change(kernel="gaussian", periodic="none"))
    assert summary(other).startswith("1 step · Gaussian · ")
    assert "kernel: Gaussian (global)" in describe_run(other)
    text = describe_run(second)
    assert all(f"{column.title}: " in text for column in COLUMNS if column.title != "name")
    assert "name" not in text
    assert "name: stiff" in describe_run(replace(second, name="stiff"))
    assert "motion: airfoil: rotate by -8° about its centroid; airfoil: translate by" in text
    assert f"minimum quality: {second.last.quality.min:.4f}" in text


def test_a_run_that_is_not_done_says_how_far_it_came(runs):
    going = replace(runs[0], frames=runs[0].frames[:1], end="")
    assert summary(going).startswith("running · moving vertices · 1 of 2 steps")
    assert summary(replace(going, end="cancelled")).startswith("cancelled · ")
    bare = Run(3, runs[0].case.change(steps=0))
    assert steps_words(bare) == "0 steps, automatic"
    found = rows(table_text([bare]))[0]
    assert found["minimum quality"] == ""
    assert found["end"] == "running"
    assert "minimum quality: –" in describe_run(bare)


def test_the_best_run_has_the_highest_minimum(runs):
    wanted = max(runs, key=lambda run: run.last.quality.min).number
    assert best_runs(runs) == best_runs(runs[::-1]) == {wanted}
    assert best_runs(runs[:1]) == set()
    assert best_runs([runs[0], Run(3, runs[0].case)]) == set(), "one of them has no result"


def test_the_best_is_one_of_the_runs_with_the_same_motion(runs):
    turned = runs[0].case.change(motions=(Rotate("airfoil", 1.0),))
    bad, good = sorted(runs, key=lambda run: run.last.quality.min)
    assert best_runs([bad, replace(good, case=turned)]) == set(), "they cannot be compared"
    twice = [bad, good, replace(bad, number=3, case=turned), replace(good, number=4, case=turned)]
    assert best_runs(twice) == {good.number, 4}
    assert best_runs([good, replace(good, number=7)]) == set(), "neither is better"
    assert best_runs([bad, good, replace(good, number=7)]) == {good.number, 7}


def test_words_of_methods_and_choices(runs):
    case = runs[0].case
    assert method_words(case.change(sliding="none")) == "no sliding"
    assert method_words(case.change(method="elastic")) == "linear elasticity"
    assert reduction_words(case) == "automatic data reduction"
    assert reduction_words(case.change(reduction=None)) == "all nodes"
    given = Reduction(relative=1e-5, multilevel=True, max_nodes=2000)
    words = reduction_words(case.change(reduction=given))
    assert words == "reduced to 1e-05 of the extent, in levels, at most 2,000 nodes"
    assert [seconds_words(t) for t in (0.0123, 2.345, 187.0)] == ["0.01 s", "2.35 s", "3 min 7 s"]
