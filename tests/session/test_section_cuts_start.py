"""Where new sections are: round numbers about in the middle, between layers of nodes."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.mesh.quality import quality
from slideviz.sections.shape import round_middle
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.section_cuts import first_section
from slideviz.session.state import StepFrame
from tests.builders import grid, ring


def layers(*at):
    return np.repeat(np.array(at, float), 49)


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        # A layer in the middle, as 0.2875 is: the cells beyond it, at the roundest number.
        (layers(0.25, 0.277621, 0.282279, 0.2875, 0.292719, 0.297377, 0.325), 0.29),
        (layers(*np.linspace(0.0, 1.0, 7)), 0.6),
        (layers(0.0, 0.5, 1.0), 0.7),
        # None there: the middle, or what is round and near to it.
        (layers(*np.linspace(-1.0, 1.0, 6)), 0.0),
        (layers(0.0, 1.0), 0.5),
        (layers(-7.31, -3.02), -5.2),
        (1e6 + layers(0.0, 1.0), 1e6 + 0.5),
        (1e-6 * layers(1.23, 4.58), 3e-6),
        (layers(2.0, 2.0), 2.0),
        (np.random.default_rng(1).random(9000), 0.5),
        (np.random.default_rng(1).random(9000) * 0.00371 + 5.0, 5.0019),
    ],
)
def test_the_middle_is_round_and_between_layers(values, wanted):
    found = round_middle(values)
    assert found == pytest.approx(wanted, rel=1e-12)
    assert values.min() <= found <= values.max()


def session_of(mesh):
    return open_mesh(StepFrame(mesh, quality(mesh)), None)


def test_sections_start_in_the_middle_of_the_step_that_is_shown():
    shape = (4, 6, 5)
    mesh = grid(shape, place=ring(shape, 0.25, 0.325, 3.0))
    session = session_of(mesh)
    longest = int(np.argmax(np.ptp(mesh.points, axis=0)))
    low, high = np.sort(mesh.points[:, longest])[[0, -1]]
    plane, cylinder = (first_section(kind, session) for kind in ("plane", "cylinder"))
    for value in (plane.position, cylinder.radius):
        assert len(f"{value:.6g}") <= 5
    assert abs(plane.position - (low + high) / 2.0) < 0.15 * (high - low)
    radii = np.hypot(*mesh.points[:, :2].T)
    assert np.abs(radii - cylinder.radius).min() > 0.003
    assert cylinder.radius == pytest.approx(0.2875, abs=0.02)
    # The mesh is twice as large at the step that is shown.
    later = mesh.with_points(2.0 * mesh.points)
    run = changes.start_run(session)
    run = changes.add_frames(run, [StepFrame(later, quality(later))])
    shown = changes.set_view(run, frame=1)
    assert shown.frame.mesh is later
    assert first_section("cylinder", shown).radius == pytest.approx(0.575, abs=0.04)
    moved = first_section("plane", shown)
    assert abs(moved.position - (low + high)) < 0.3 * (high - low)
    assert replace(moved, origin=plane.origin) == plane
