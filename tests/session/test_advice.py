"""What a run says of itself when it is over."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.reduction import Reduction
from slideviz.deformation import solver
from slideviz.deformation.solver import deform
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.quality import INVERTED, quality
from slideviz.session.run_messages import ended, exact_cost, help_for, inverted_words
from slideviz.session.state import Run, StepFrame


@pytest.fixture(scope="module")
def run(passage):
    """One of two steps."""
    case = passage.case.change(sliding="none", periodic="none", steps=2)
    frames = [
        StepFrame(s.mesh, quality(s.mesh, passage.mesh), s) for s in deform(case, passage.mesh)
    ]
    return Run(1, case, tuple(frames), "done")


def with_inverted(run, count):
    status = run.last.quality.status.copy()
    status[:count] = INVERTED
    bad = replace(run.last.quality, status=status)
    return replace(run, frames=(*run.frames[:-1], replace(run.last, quality=bad)))


def test_it_tells_the_end_and_the_inverted_cells(run):
    assert ended(replace(run, frames=())) == "Ready."
    assert ended(run) == "Done."
    assert ended(with_inverted(run, 1)) == "Done: 1 inverted cell"
    assert inverted_words(with_inverted(run, 12)) == "12 inverted cells"
    stopped = replace(run, frames=run.frames[:1])
    assert ended(stopped) == "Stopped after step 1 of 2."
    assert ended(with_inverted(stopped, 3)) == "Stopped after step 1 of 2: 3 inverted cells."


@pytest.mark.parametrize(
    ("case", "words", "not_words"),
    [
        (Case(roles={"a": "sliding"}), ("sliding", "more steps"), ("radial",)),
        (
            Case(roles={"a": "fixed", "b": "moving"}, steps=0),
            ("help: the role “sliding” for boundaries near these cells, and a", "smaller motion"),
            ("steps",),
        ),
        (Case(roles={"a": "fixed"}, sliding="ps"), ("help: the role “sliding”",), ("method",)),
        (Case(roles={"a": "sliding", "b": "fixed"}, sliding="ps"), (), ("sliding",)),
        (Case(method="elastic", sliding="ds", steps=1), ("radial", "more steps"), ("sliding b",)),
    ],
)
def test_it_offers_what_the_case_has_not_used(case, words, not_words):
    text = help_for(case)
    assert all(word in text for word in words)
    assert not any(word in text for word in not_words)


def test_where_the_motion_goes_through_itself_no_steps_are_offered():
    folding = "airfoil goes through itself near (0, 0); cells will be inverted there."
    assert help_for(Case(steps=2), folding) == (
        "airfoil goes through itself near (0, 0), so more steps cannot help; another motion, or a "
        "smaller one, may."
    )


def test_a_large_exact_run_is_told_beforehand(monkeypatch):
    nodes = np.arange(30_000)
    line = Marker("wall", Cells.from_blocks([(3, np.stack([nodes[:-1], nodes[1:]], axis=1))]))
    points = np.random.default_rng(1).random((30_000, 2))
    mesh = Mesh(points, Cells.from_blocks([(5, np.array([[0, 1, 2]]))]), (line,))
    monkeypatch.setattr(solver, "free_memory", lambda: 12e9)
    text = exact_cost(Case(steps=3, reduction=None), mesh)
    assert text.startswith("30,000 control nodes, without data reduction: about 19 GB of memory ")
    assert "(12 GB are free) and 45 minutes, more or less." in text
    monkeypatch.setattr(solver, "free_memory", lambda: float("inf"))
    assert "free" not in exact_cost(Case(reduction=None), mesh)
    for small in (
        Case(),
        Case(reduction=Reduction()),
        Case(method="idw"),
        Case(roles={"wall": "internal"}, reduction=None),
    ):
        assert exact_cost(small, mesh) == ""
