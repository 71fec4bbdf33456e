"""What a run says of itself when it is over."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.errors import Doubt, Message
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.quality import INVERTED, quality
from slideviz.rbf.reduction import Reduction
from slideviz.session import run_messages
from slideviz.session.motions import largest_prescribed
from slideviz.session.run_messages import (
    end_parts,
    exact_cost,
    inverted_words,
    remedy_for,
    tolerance_warning,
)
from slideviz.session.state import Run, StepFrame
from slideviz.solver.deform import deform
from slideviz.solver.remedies import beyond_pitch
from tests.advice import advice_for
from tests.builders import sector


def end_message(run):
    return "".join(end_parts(run))


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
    assert end_message(replace(run, frames=())) == "Ready."
    assert end_message(run) == "Done."
    assert end_message(with_inverted(run, 1)) == "Done: 1 inverted cell."
    assert inverted_words(with_inverted(run, 12)) == "12 inverted cells"
    stopped = replace(run, frames=run.frames[:1])
    assert end_message(stopped) == "Stopped after step 1 of 2."
    assert end_message(with_inverted(stopped, 3)) == "Stopped after step 1 of 2: 3 inverted cells."


@pytest.mark.parametrize(
    ("case", "words", "not_words"),
    [
        (Case(roles={"a": "sliding"}), ("sliding", "more steps"), ("radial",)),
        (
            Case(roles={"a": "fixed", "b": "moving"}, steps=0),
            ("help: the role “sliding” for", "near these cells, and a sliding", "smaller motion"),
            ("steps",),
        ),
        (Case(roles={"a": "fixed"}, sliding="ps"), ("help: the role “sliding”",), ("method",)),
        (Case(roles={"a": "sliding", "b": "fixed"}, sliding="ps"), (), ("sliding",)),
        (Case(method="elastic", sliding="ds", steps=1), ("radial", "more steps"), ("sliding b",)),
    ],
)
def test_it_offers_what_the_case_has_not_used(case, words, not_words):
    """The window and the command line offer the same, in the same order."""
    mesh = Mesh(np.zeros((3, 2)), Cells.from_blocks([(5, [[0, 1, 2]])]))
    text = remedy_for(Run(1, case), mesh)
    assert all(word in text for word in words)
    assert not any(word in text for word in not_words)
    assert advice_for(case, None).count(";") == text.count(";")


def test_where_the_motion_goes_through_itself_no_steps_are_offered(run, passage):
    folding = Message("airfoil goes through itself near (0, 0)", "move it less")
    assert remedy_for(run, passage.mesh, folding) == f"{folding}."


def test_where_a_motion_is_doubtful_its_own_remedy_comes_first(run, passage):
    doubt = Doubt("the chord goes from x = 0 to 1", "end its MOTION with 0, 120", ("motion 1",))
    assert remedy_for(run, passage.mesh, doubt) == (
        "motion 1: the chord goes from x = 0 to 1; end its Motion with 0, 120."
    )
    bad = with_inverted(run, 1)
    step = replace(bad.last.step, messages=("other", doubt))
    told = replace(bad, frames=(*bad.frames[:-1], replace(bad.last, step=step)))
    assert "What may help: end its Motion with 0, 120; " in remedy_for(told, passage.mesh)
    assert "what may help: end its MOTION with 0, 120; " in advice_for(bad.case, step)


def test_fixed_boundaries_beside_inverted_cells_and_the_last_valid_step_are_named(run, passage):
    """Only boundaries that touch the cells: here those of the first cell at the blade's wall."""
    mesh, case = passage.mesh, run.case
    last = with_inverted(run, 0).last.quality
    wall = np.isin(mesh.cells.connectivity, mesh.marker("outflow").nodes)
    cell = int(np.searchsorted(mesh.cells.offsets, np.flatnonzero(wall)[0], side="right")) - 1
    status = np.where(np.arange(len(mesh.cells)) == cell, INVERTED, last.status)
    bad = replace(last, status=status)
    frames = (run.frames[0], replace(run.last, quality=bad))
    fixed = dict(case.roles) | {"outflow": "fixed", "inflow": "fixed"}
    of_fixed = replace(run, case=case.change(roles=fixed), frames=frames)
    text = remedy_for(of_fixed, mesh)
    assert text.startswith("Step 1 of 2 is the last without any. What may help: the role “slid")
    assert "“sliding” for outflow beside these cells, and a sliding method; relaxation" in text
    assert "MARKER_SLIDING for outflow beside these cells, and SLIDING_MODE= ps or ds; RELAX" in (
        advice_for(of_fixed.case, None, mesh, bad)
    )
    without = replace(of_fixed, frames=frames[1:])
    assert remedy_for(without, mesh).startswith("What may help: ")


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (Translate("airfoil", (0.0, 0.7)), ""),
        (Translate("airfoil", (9.0, 0.0)), ""),
        (
            Translate("airfoil", (0.1, -0.8)),
            "The motion is 0.8, farther than the pitch: 0.75",
        ),
    ],
)
def test_a_motion_beyond_the_pitch_is_named(run, passage, motion, words):
    case = passage.case.change(motions=(motion,), periodic="moving", sliding="ps")
    text = remedy_for(replace(run, case=case, frames=()), passage.mesh)
    assert text.startswith(words or "What may help")
    assert ("a motion below the pitch" in text) == bool(words)
    assert "pitch" not in remedy_for(replace(run, case=case.change(periodic="none")), passage.mesh)


def test_a_rotation_beyond_the_pitch_is_named_in_degrees(run, passage):
    """A sector of 90 degrees, turned about its axis."""
    mesh = sector(angle_deg=90.0)
    roles = {"per1": "periodic", "per2": "periodic", "inner": "moving"}
    case = Case(roles=roles, periodic="moving", sliding="ps")
    for angle, words in ((89.0, ""), (-95.0, "The motion is 95°, farther than the pitch: 90° ab")):
        turned = case.change(motions=(Rotate("inner", angle, (0.0, 0.0)),))
        assert beyond_pitch(turned, mesh).startswith(words)
        assert bool(beyond_pitch(turned, mesh)) == bool(words)


@pytest.mark.parametrize(
    ("reduction", "words"),
    [
        (Reduction(tolerance=0.01), ""),
        (Reduction(tolerance=0.05), "This is more than a tenth of the largest displacement, 0.2: "),
        (Reduction(relative=0.1), "This is not below the largest displacement, 0.2: cells near"),
        (Reduction(auto=True, tolerance=1.0), ""),
        (None, ""),
    ],
)
def test_a_tolerance_above_the_motion_is_told_before_a_run(passage, reduction, words):
    case, motion = passage.case, Translate("airfoil", (0.0, 0.2))
    largest = largest_prescribed(case.change(motions=(motion,)), passage.mesh)
    assert largest == pytest.approx(0.2)
    text = tolerance_warning(case.change(reduction=reduction), 2.0, largest)
    assert text.startswith(words)
    assert bool(text) == bool(words)
    assert text.endswith("A hundredth of it is 0.002." if words else "")
    assert tolerance_warning(case.change(reduction=reduction), 2.0, 0.0) == ""
    assert largest_prescribed(case.change(motions=()), passage.mesh) == 0.0


def test_a_large_exact_run_is_told_beforehand(monkeypatch):
    nodes = np.arange(30_000)
    line = Marker("wall", Cells.from_blocks([(3, np.stack([nodes[:-1], nodes[1:]], axis=1))]))
    points = np.random.default_rng(1).random((30_000, 2))
    mesh = Mesh(points, Cells.from_blocks([(5, np.array([[0, 1, 2]]))]), (line,))
    monkeypatch.setattr(run_messages, "free_memory", lambda: 12e9)
    text = exact_cost(Case(steps=3, reduction=None), mesh)
    assert text.startswith("30,000 control nodes, without data reduction: about 19 GB of memory ")
    assert "(12 GB are free) and 45 minutes, more or less." in text
    monkeypatch.setattr(run_messages, "free_memory", lambda: float("inf"))
    assert "free" not in exact_cost(Case(reduction=None), mesh)
    for small in (
        Case(),
        Case(reduction=Reduction()),
        Case(method="idw"),
        Case(roles={"wall": "internal"}, reduction=None),
    ):
        assert exact_cost(small, mesh) == ""
