"""Deformed meshes as a start: shapes, layers and qualities are those of their reference."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.zones import zones_of
from slideviz.solver.prepare import prepare
from slideviz.streaming.stream_input import open_read_only
from tests import builders
from tests.solver.test_interface_motion import both, stage
from tests.test_laws import box, box_case, sector, sector_case


def last(case, mesh, **options):
    *_, step = sv.deform(case, mesh, **options)
    return step


def reverse(case):
    """The case that moves back: the opposite of each motion, in the opposite order."""
    back = [
        replace(each, vector=tuple(-part for part in each.vector))
        if isinstance(each, sv.Translate)
        else replace(each, angle_deg=-each.angle_deg)
        for each in reversed(case.motions)
    ]
    return case.change(motions=tuple(back))


def homes(case, mesh):
    """How far from home a motion and its reverse lead, over the motion: without and with it."""
    out = last(case, mesh).mesh
    gone = np.abs(out.points - mesh.points).max()
    ends = (last(reverse(case), out, reference=base).mesh for base in (None, mesh))
    return [np.abs(end.points - mesh.points).max() / gone for end in ends]


SMALL = st.floats(-0.06, 0.06).map(lambda value: round(value, 4))
CENTER = (0.5, 0.5, 0.5)


def moved(marker, shift, angle, dim):
    turn = (0.0, 0.0, 1.0) if dim == 2 else (0.3, 0.4, 1.0)
    return sv.Translate(marker, tuple(shift[:dim])), sv.Rotate(marker, angle, CENTER[:dim], turn)


def made(name, shift, angle):
    """A mesh and a case of a kind of boundaries, which is relaxed."""
    dim = 3 if name.endswith("3d") else 2
    if name.startswith("box"):
        mesh = box(dim)
        case = box_case(mesh, ("ps", "moving"), moved("BLOCK", shift, angle, dim))
    elif name.startswith("sector"):
        mesh = sector(dim)
        marker = "BLOCK" if dim == 2 else "blade"
        case = sector_case(mesh, ("ds", "fixed"), moved(marker, shift, angle, dim))
    elif name == "curved":
        mesh = builders.annulus(24, 5, 2)
        roles = {"wall": "moving", "far0": "sliding", "far1": "sliding"}
        case = sv.Case(roles=roles, motions=moved("wall", shift, angle, 2), sliding="ps")
    elif name == "curved 3d":
        mesh = builders.sphere_in_box(4, 2)
        roles = dict.fromkeys(mesh.marker_names, "sliding") | {"x_p": "moving"}
        case = sv.Case(roles=roles, motions=moved("x_p", shift, 0.2 * angle, 3), sliding="ds")
    else:
        mesh = builders.airfoil(40, 10, 1e-3)
        roles = {"airfoil": "moving"}
        motions = moved("airfoil", shift, 2.0 * angle, 2)
        return mesh, sv.Case(roles=roles, motions=motions, relax="yes", layers="auto")
    return mesh, case.change(relax="yes")


KINDS = ("box", "box 3d", "sector", "sector 3d", "curved", "curved 3d", "layers")


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=4, deadline=None)
@given(shift=st.tuples(SMALL, SMALL, SMALL), angle=st.floats(1.0, 8.0))
def test_a_motion_and_its_reverse_lead_home(name, shift, angle):
    mesh, case = made(name, shift, angle)
    assert homes(case, mesh)[1] < 1e-3


@pytest.mark.parametrize("name", KINDS)
def test_without_a_reference_they_do_not(name):
    mesh, case = made(name, (0.05, -0.04, 0.03), 6.0)
    without, with_it = homes(case, mesh)
    assert with_it < 1e-3 < without


def test_zones_have_a_reference_each(tmp_path):
    mesh = sv.read(stage(tmp_path))
    case = both().change(relax="yes")
    out = last(case, mesh).mesh
    back = last(reverse(case), out, reference=mesh).mesh
    gone = np.abs(out.points - mesh.points).max()
    assert np.abs(back.points - mesh.points).max() < 1e-3 * gone
    assert np.abs(last(reverse(case), out).mesh.points - mesh.points).max() > 1e-3 * gone
    of_zones = [zone.undeformed for zone in zones_of(out.with_reference(mesh))]
    assert [np.array_equal(*pair) for pair in zip_points(of_zones, zones_of(mesh))] == [True, True]


def zip_points(ours, theirs):
    return [(one.points, other.points) for one, other in zip(ours, theirs, strict=True)]


def test_walls_that_moved_themselves_are_those_of_the_mesh():
    """The outer wall is turned and enlarged by the first motion, and nodes slide on it then."""
    mesh = builders.annulus(24, 5, 2)
    roles = {"wall": "moving", "far0": "moving", "far1": "moving"}
    grown = (sv.Scale(("far0", "far1"), (1.1, 1.1), (0.0, 0.0)), sv.Translate("wall", (0.02, 0.0)))
    out = last(sv.Case(roles=roles, motions=grown, relax="yes"), mesh).mesh
    roles |= {"far0": "sliding", "far1": "sliding"}
    case = sv.Case(roles=roles, motions=(sv.Rotate("wall", 9.0),), sliding="ps", relax="yes")
    step = last(case, out, reference=mesh)
    for name in ("far0", "far1"):
        nodes = mesh.marker(name).nodes
        size = np.linalg.norm(step.mesh.points[nodes], axis=1)
        assert size.min() > 1.07 * np.linalg.norm(mesh.points[nodes], axis=1).min()
    assert sv.quality(step.mesh, mesh).inverted == 0


def test_qualities_and_layers_compare_with_the_reference():
    mesh = builders.airfoil(40, 10, 1e-3)
    case = sv.Case(roles={"airfoil": "moving"}, motions=(sv.Rotate("airfoil", 9.0, (0.5, 0.0)),))
    case = case.change(repair="yes", repair_below=0.9, steps=0)
    out = last(case, mesh).mesh
    step = last(case, out, reference=mesh)
    now = out.with_reference(mesh)
    assert step.mesh.reference is mesh
    expected = sv.quality(step.mesh, mesh).values
    for base in (now, step.mesh, mesh):
        np.testing.assert_array_equal(sv.quality(step.mesh, base).values, expected)
        heights = sv.walls(step.mesh, base).values["height_ratio"]
        np.testing.assert_array_equal(heights, sv.walls(step.mesh, mesh).values["height_ratio"])
    assert np.abs(sv.quality(step.mesh, out).values - expected).max() > 1e-3
    assert now.with_reference(None).undeformed.reference is None
    assert out.with_reference(now).reference is mesh  # and not a chain of them


def test_a_deformer_has_the_same_reference():
    mesh, case = made("box", (0.05, -0.04, 0.03), 6.0)
    out = last(case, mesh).mesh
    deformer = sv.Deformer(out, reverse(case), reference=mesh)
    run = last(reverse(case), out, reference=mesh, converged=True).mesh.points
    np.testing.assert_allclose(deformer.deform(), run, rtol=0, atol=1e-12)
    again = deformer.refresh(0.5 * deformer.displacement)
    assert again.mesh.reference is mesh
    rng = np.random.default_rng(1)
    weights = rng.normal(size=mesh.points.shape)
    design = 0.5 * deformer.displacement
    forward = (weights * again.jvp(design, design)).sum()
    assert forward == pytest.approx((design * again.vjp(design, weights)).sum(), rel=1e-11)
    ends = [again.deform((0.5 + h) * deformer.displacement) for h in (1e-5, -1e-5)]
    change = (weights * (ends[0] - ends[1])).sum() / 2e-5
    assert change == pytest.approx(2.0 * forward, rel=1e-6)


def renumbered(mesh):
    cells = mesh.cells
    (vtk,) = cells.by_type
    nodes = cells.by_type[vtk][1].copy()
    nodes[3] = np.roll(nodes[3], 1)
    return sv.Mesh(mesh.points, sv.Cells.from_blocks([(vtk, nodes)]), mesh.markers)


FAULTS = {
    "dimensions": (lambda _: builders.cube(3), "it has 3 dimensions instead of 2"),
    "count": (lambda _: builders.square(4), r"it has \d+ points instead of \d+"),
    "types": (
        lambda mesh: sv.Mesh(
            mesh.points,
            sv.Cells.from_types(
                np.full(len(mesh.cells), 5), mesh.cells.connectivity[: 3 * len(mesh.cells)]
            ),
        ),
        "cell 0 is a triangle instead of a quadrilateral",
    ),
    "cells": (
        lambda mesh: sv.Mesh(mesh.points, mesh.cells.take(np.arange(5)), mesh.markers),
        r"it has 5 cells instead of \d+",
    ),
    "connectivity": (renumbered, "cell 3 has other nodes, or the same in another order"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_mesh_of_other_cells_is_refused(fault):
    make, why = FAULTS[fault]
    mesh, case = made("box", (0.05, 0.0, 0.0), 1.0)
    said = rf"cannot be the reference of .*must have the same cells, but {why}; give the undef"
    with pytest.raises(MeshError, match=said):
        last(case, mesh, reference=make(mesh))


def test_several_zones_are_no_reference_of_one(tmp_path):
    mesh = sv.read(stage(tmp_path))
    alone = sv.Mesh(mesh.points, mesh.cells, mesh.markers)
    with pytest.raises(MeshError, match="it has 2 zones instead of 1"):
        alone.with_reference(mesh)


@pytest.fixture
def chained(tmp_path, monkeypatch):
    """A case file of the way back, with its meshes, and the mesh that the way leads to."""
    monkeypatch.chdir(tmp_path)
    mesh, case = made("box", (0.05, -0.04, 0.03), 6.0)
    sv.write("start.su2", mesh)
    start = sv.read("start.su2")
    sv.write("out.su2", last(case, start).mesh)
    back = reverse(case).change(
        mesh_file="out.su2", reference_file="start.su2", generate_quality=False
    )
    back.write("back.cfg")
    return start, back


def test_a_case_file_names_it(chained, capsys, tmp_path):
    start, _ = chained
    assert "REFERENCE_FILENAME= start.su2" in (tmp_path / "back.cfg").read_text()
    case = sv.Case.read("back.cfg")
    assert case.reference_file == Path("start.su2")
    assert run(["run", "back.cfg", "-o", "home.su2", "-q", "--json", "home.json"]) == 0
    home = sv.read("home.su2").points
    assert np.abs(home - start.points).max() < 1e-6
    found = json.loads((tmp_path / "home.json").read_text())["quality"]
    assert found["min"] == pytest.approx(1.0, abs=1e-5)
    run_in_python = last(case, sv.read("out.su2"))
    np.testing.assert_array_equal(run_in_python.mesh.points, home)
    assert prepare(case, sv.read("out.su2")).mesh.undeformed.name == "start.su2"
    rows = list(sv.sweep(case, {"motion1.angle_deg": [0.0, -6.0]}, workers=1))
    assert rows[1].min == pytest.approx(1.0, abs=1e-3)
    assert run(["quality", "home.su2", "--case", "back.cfg"]) == 0
    assert "start.su2" in capsys.readouterr().out


def test_def_and_dot_know_it(chained, tmp_path):
    start, _ = chained
    moved = sv.read("out.su2").points
    nodes = start.marker("BLOCK").nodes
    rows = [
        f"{k} {x!r} {y!r}" for k, (x, y) in zip(nodes, start.points[nodes].tolist(), strict=True)
    ]
    (tmp_path / "surface_positions.dat").write_text("\n".join(rows))
    (tmp_path / "su2.cfg").write_text(
        "MESH_FILENAME= out.su2\nMESH_OUT_FILENAME= home.su2\nREFERENCE_FILENAME= start.su2\n"
        "DV_MARKER= (BLOCK)\nDV_KIND= SURFACE_FILE\nMARKER_SYM= (x_m, x_p)\n"
        "MARKER_PERIODIC= (y_m, y_p, 0, 0, 0, 0, 0, 0, 0, 1, 0)\n"
    )
    assert run(["def", "su2.cfg", "-q"]) == 0
    gone = np.abs(moved - start.points).max()
    assert np.abs(sv.read("home.su2").points - start.points).max() < 1e-3 * gone


def test_a_streamed_run_says_at_once_that_it_has_none(chained, capsys, tmp_path):
    (tmp_path / "out.su2").write_text("not read")
    assert run(["run", "back.cfg", "--stream", "-o", "home.su2", "--set", "RELAX=NO"]) == 1
    said = capsys.readouterr().err
    assert "REFERENCE_FILENAME needs both meshes in memory and cannot be streamed" in said
    case = sv.Case.read("back.cfg")
    with open_read_only(tmp_path / "start.su2", None, lambda _: None, tmp_path) as held:
        skin = held.skin(lambda _: None)
    with pytest.raises(CaseError, match="cannot be streamed; leave it out"):
        prepare(case, skin)
