"""Layers that give way: heights in closing gaps, their continuity, reports and derivatives."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.motions.rigid import Translate
from slideviz.cli import run
from slideviz.samples.turbine_row import SPAN, extruded
from slideviz.session import jobs
from slideviz.session.run_messages import remarks_of
from slideviz.session.state import Run, StepFrame
from slideviz.solver.layers import height_warnings
from tests.design.test_deformer_derivatives import check_relaxed
from tools.study.flows import grid_mesh

HEIGHT = 0.2
LAYER = np.concatenate([[0.0], np.cumsum(1e-3 * 1.2 ** np.arange(10))])
"""Heights of the ten layers on each wall of `channel`."""


def channel(columns=40, core=24, length=1.0):
    """A channel between walls ``low`` and ``high`` with ten layers each, and its nodes by rows."""
    middle = np.linspace(LAYER[-1], HEIGHT - LAYER[-1], core + 1)[1:-1]
    y = np.concatenate([LAYER, middle, HEIGHT - LAYER[::-1]])
    z = np.linspace(0.0, length, columns + 1) + 1j * y[:, None]
    node = np.arange(z.size).reshape(z.shape)
    sides = {"low": node[0], "high": node[-1], "in": node[:, 0], "out": node[:, -1]}
    return grid_mesh(z, node.T, sides), node


def closing(motion, **changes):
    """The case in which the lower wall has a motion, and the ends slide."""
    roles = {"low": "moving", "in": "sliding", "out": "sliding"}
    return Case(
        roles=roles,
        motions=(motion,),
        **{"sliding": "ps", "relax": "auto", "layers": "auto", **changes},
    )


def closed(mesh, gap, **changes):
    *_, last = sv.deform(closing(Translate("low", (0.0, HEIGHT - gap)), **changes), mesh)
    return last


def ratios(last, mesh, node):
    """The first heights of both walls, and the largest ratio of neighbours across the channel."""
    walls = sv.walls(last.mesh, mesh).summary()
    first = [walls[name]["first_height"]["ratio"] for name in ("low", "high")]
    edges = np.linalg.norm(np.diff(last.mesh.points[node], axis=0), axis=2)
    beside = np.exp(np.abs(np.log(edges[1:] / edges[:-1])))
    return min(row["min"] for row in first), max(row["max"] for row in first), beside.max()


def test_layers_of_a_closing_gap_stay_while_there_is_room_and_then_give_way():
    mesh, node = channel()
    for gap in (0.1, 0.07):
        last = closed(mesh, gap)
        assert ratios(last, mesh, node)[:2] == pytest.approx((1.0, 1.0), abs=1e-9)
        assert not last.kept_layers.gave_way
        assert not last.messages
    before = 1.0
    for gap, lowest in ((0.05, 0.45), (0.03, 0.33), (0.02, 0.25), (0.01, 0.15)):
        last = closed(mesh, gap)
        least, most, beside = ratios(last, mesh, node)
        found = sv.quality(last.mesh, mesh)
        assert found.inverted == 0
        assert found.min > lowest
        assert beside < 2.5
        assert most < before
        assert {one.names for one in last.kept_layers.gave_way} == {("low",), ("high",)}
        for one in last.kept_layers.gave_way:
            assert least - 1e-9 < one.height < most + 1e-9
        before = least
    case = closing(Translate("low", (0.0, HEIGHT - gap)))
    walls = sv.walls(last.mesh, mesh)
    assert height_warnings(case, walls, last.mesh)
    assert not height_warnings(case, walls, last.mesh, last.kept_layers)
    assert not any("LAYER_THICKNESS" in text for text in last.warnings)


def test_the_minimum_gap_says_when_layers_give_way():
    mesh, node = channel()
    assert ratios(closed(mesh, 0.03, layer_minimum_gap=0.0), mesh, node)[0] > 1.0 - 1e-9
    heights = [
        ratios(closed(mesh, 0.06, layer_minimum_gap=gap), mesh, node)[0] for gap in (0.2, 0.4, 0.6)
    ]
    assert 1.0 - 1e-9 < heights[0] > heights[1] > heights[2] > 0.3


def test_layers_that_give_way_are_in_the_report_the_summary_and_the_window(tmp_path, capsys):
    mesh, _ = channel(20)
    sv.write(tmp_path / "mesh.su2", mesh)
    case = closing(Translate("low", (0.0, 0.17)), mesh_file=tmp_path / "mesh.su2")
    case.write(tmp_path / "case.cfg")
    files = [str(tmp_path / "case.cfg"), "-o", str(tmp_path / "out.su2")]
    assert run(["run", *files, "--json", str(tmp_path / "report.json")]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    walls = {tuple(row["boundaries"]): row["gave_way"] for row in report["layers"]["walls"]}
    assert set(walls) == {("low",), ("high",)}
    heights = report["walls"]["low"]["first_height"]["ratio"]
    assert heights["min"] - 1e-9 < walls["low",]["height"] < heights["max"]
    assert 0.17 < walls["low",]["at"][1] < 0.2
    said = [text for text in report["warnings"] if "gave way" in text]
    assert len(said) == 2
    assert said[0].startswith(f"the layers at low gave way, to {walls['low',]['height']:.3g} times")
    assert said[0] in capsys.readouterr().err
    frames = []
    jobs.compute(case, mesh, jobs.Job(frames.append))
    ended = Run(1, case, tuple(each for each in frames if isinstance(each, StepFrame)), "done")
    shown = [text for text in remarks_of(ended, "warning") if "gave way" in text]
    assert [text.split(";")[0] for text in shown] == [text.split(";")[0] for text in said]


def heights(last, mesh):
    """The ratios of first heights at all nodes of both walls."""
    walls = sv.walls(last.mesh, mesh)
    places = [walls.columns.places(name) for name in ("low", "high")]
    return walls.values["height_ratio"][np.concatenate(places)]


@given(columns=st.integers(12, 24), core=st.integers(16, 30), gap=st.floats(0.02, 0.08))
@settings(max_examples=8, deadline=None)
def test_heights_are_continuous_in_the_motion(columns, core, gap):
    """To what the minimisation leaves."""
    mesh, _ = channel(columns, core)
    one, other = (closed(mesh, gap * part) for part in (1.0, 0.995))
    change = np.abs(heights(other, mesh) - heights(one, mesh))
    assert change.max() < 0.1
    assert np.median(change) < 0.03


@given(
    columns=st.integers(20, 30),
    gap=st.floats(0.03, 0.06),
    tilt=st.floats(-0.5, 0.5),
    along=st.floats(-0.02, 0.02),
)
@example(columns=27, gap=0.05439810717600817, tilt=0.4127555772777217, along=0.004265431030687196)
@example(columns=22, gap=0.050036682167140537, tilt=0.4584136317779519, along=0.017028583088576753)
@settings(max_examples=8, deadline=None, phases=(Phase.explicit, Phase.generate))
def test_gaps_close_in_any_direction(columns, gap, tilt, along):
    """The lower wall comes near the upper one obliquely, and a little along it."""
    mesh, _ = channel(columns, 20)
    nodes = mesh.marker("low").nodes
    x = mesh.points[nodes, 0]
    inside = np.sin(np.pi * x) ** 2
    up = (HEIGHT - gap) * (1.0 + tilt * (x - 1.0) * inside) * inside
    vectors = np.stack([along * inside, np.minimum(up, HEIGHT - gap)], axis=1)
    *_, last = sv.deform(closing(Prescribed(nodes, vectors, "low")), mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0
    assert heights(last, mesh).max() < 1.01
    least = min((one.height for one in last.kept_layers.gave_way), default=1.0)
    assert heights(last, mesh).min() > 0.9 * least


def test_where_there_is_room_nothing_changes():
    mesh, _ = channel(20)
    plain = closed(mesh, 0.15, layer_minimum_gap=0.0)
    last = closed(mesh, 0.15)
    assert np.array_equal(plain.mesh.points, last.mesh.points)
    assert last.relaxed == plain.relaxed


def test_a_gap_that_closes_in_3d_between_turned_walls():
    """The tip of a blade near its casing, in a mesh turned about no axis of it."""
    mesh, _ = channel(16, 12)
    straight = extruded(mesh, 8)
    points = straight.points * [1.0, 1.0, 0.5 / SPAN]
    turn = Rotation.from_rotvec([0.2, 0.4, 0.6]).as_matrix()
    solid = straight.with_points(points @ turn.T)
    nodes = np.unique(solid.marker("low").nodes)
    x, _, z = points[nodes].T
    up = 0.17 * np.exp(-((x - 0.5) ** 2) / 0.03 - (z - 0.2) ** 2 / 0.05)
    moved = np.stack([0 * up, up, 0 * up], axis=1) @ turn.T
    case = closing(Prescribed(nodes, moved, "low"))
    case = case.change(roles={**case.roles, "HUB": "sliding", "SHROUD": "sliding"})
    *_, last = sv.deform(case, solid)
    found = sv.quality(last.mesh, solid)
    assert found.inverted == 0
    assert found.min > 0.2
    gave_way = {one.names: one for one in last.kept_layers.gave_way}
    assert set(gave_way) == {("low",), ("high",)}
    at = np.array(gave_way["high",].point) @ turn
    assert at == pytest.approx([0.5, 0.2, 0.2], abs=0.1)


def test_derivatives_where_layers_give_way():
    mesh, _ = channel(12, 16, 0.6)
    settings = {"reduction": None, "kernel": "wendland-c0", "layer_minimum_gap": 0.6}
    case = closing(Translate("low", (0.0, 0.13)), **settings)
    *_, last = sv.deform(case, mesh)
    assert last.kept_layers.gave_way
    check_relaxed(case, mesh)
