"""Motions onto surfaces: their text, the files of targets, and what is refused."""

from pathlib import Path

import meshio
import numpy as np
import pytest

import slideviz as sv
from slideviz.case.check import motion_problems
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.motions.onto import is_laid
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError
from tests.builders import airfoil, cube, sphere_in_box, square

SPLIT = np.array([[0, 1, 2], [0, 2, 3]])


def case(path, limit=0.0, marker="airfoil"):
    return sv.Case(roles={marker: "moving"}, motions=(sv.Onto(path, marker, limit),))


@pytest.fixture
def shifted(tmp_path):
    """An airfoil 0.2 higher, as a mesh in a file."""
    mesh = airfoil(40)
    sv.write(tmp_path / "high.su2", mesh.with_points(mesh.points + np.array([0.0, 0.2])))
    return tmp_path / "high.su2"


def test_its_text_has_a_path_and_a_limit():
    text = '(BLADE, onto, "as built.stl", 0.001)'
    (motion,) = read_motions(text)
    assert motion == sv.Onto(Path("as built.stl"), "BLADE", 0.001)
    assert write_motions((motion,)) == text
    assert write_motions((sv.Onto(Path("a.stl")),)) == "(*, onto, a.stl)"
    assert describe(motion, 3, 1.0).endswith("lay onto as built.stl")
    cases = [sv.Case(motions=(one,)) for one in (motion, sv.Onto(Path("b.stl"), "BLADE"))]
    assert motion_labels(cases) == ["lay onto as built.stl", "lay onto b.stl"]
    for wrong, match in (
        ("(BLADE, onto)", r"expected \(MARKER, onto, path\)"),
        ("(BLADE, onto, a.stl, 0)", "the limit 0 is not above 0"),
    ):
        with pytest.raises(CaseError, match=match):
            read_motions(wrong)


def test_paths_are_relative_to_the_case(tmp_path):
    (tmp_path / "a.cfg").write_text("MARKER_MOVING= ( a )\nMOTION= (a, onto, b.stl, 0.5)\n")
    read = sv.Case.read(tmp_path / "a.cfg")
    assert read.motions == (sv.Onto(tmp_path / "b.stl", "a", 0.5),)
    assert read.inputs()[tmp_path / "b.stl"] == "a file of a motion"


def test_curves_and_surfaces_of_several_formats(shifted, tmp_path):
    mesh = airfoil(40)
    nodes = mesh.marker("airfoil").nodes
    lines = mesh.marker("airfoil").cells.by_type[3][1]
    points = np.column_stack([mesh.points + np.array([0.0, 0.2]), np.zeros(len(mesh.points))])
    meshio.write(tmp_path / "high.vtu", meshio.Mesh(points, [("line", lines)]))
    assert not is_laid(case(shifted), mesh)
    for path in (shifted, tmp_path / "high.vtu"):
        moved = displacements(case(path), mesh)
        assert moved.at(nodes) == pytest.approx(np.tile([0.0, 0.2], (len(nodes), 1)), abs=0.01)
        assert "airfoil lies on high" in str(moved.warnings[0])
        assert moved.warnings[0].report["distance"] < 1e-12
    assert is_laid(case(shifted), mesh)
    sphere = sphere_in_box(4)
    x = sphere.points + np.array([0.1, 0.0, 0.0])
    quads = sphere.marker("sphere").cells.by_type[9][1]
    meshio.write(tmp_path / "sphere.vtu", meshio.Mesh(x, [("quad", quads)]))
    moved = displacements(case(tmp_path / "sphere.vtu", marker="sphere"), sphere)
    assert moved.vectors == pytest.approx(np.tile([0.1, 0, 0], (len(moved.nodes), 1)), abs=1e-2)


def test_what_does_not_fit_is_refused(shifted, tmp_path):
    mesh, box = airfoil(40), sphere_in_box(4)

    def refused(case, mesh, match):
        for _ in range(2):  # what is cached is refused again
            with pytest.raises(CaseError, match=match):
                displacements(case, mesh)

    refused(case(tmp_path / "none.stl"), mesh, "there is no such file")
    refused(case(shifted, marker="sphere"), box, "it has no surface, and .* has 3 dimensions")
    refused(case(shifted, marker="x_m"), square(6), r"without a boundary x_m \(it has airfoil, far")
    corners = np.array([[0, 0, 1.1], [1, 0, 1.2], [1, 1, 1.1], [0, 1, 1.0]])

    def plate(points):
        meshio.write(tmp_path / "plate.stl", meshio.Mesh(points, [("triangle", SPLIT)]))
        return case(tmp_path / "plate.stl", marker="z_p")

    block = cube(4)
    assert len(displacements(plate(corners), block).nodes) == 25
    refused(plate(corners[:, [2, 0, 1]]), block, "25 of 25 nodes of z_p do not face this surface")
    small = corners * [0.8, 0.8, 1.0]
    refused(plate(small), block, r"remains up to 0\.2.*the limit is 0\.01, 1% .*onto, plate")
    assert (
        len(
            displacements(
                sv.Case(
                    roles={"z_p": "moving"}, motions=(sv.Onto(tmp_path / "plate.stl", "z_p", 0.5),)
                ),
                block,
            ).nodes
        )
        == 25
    )


def test_it_comes_before_other_motions(shifted):
    mesh, onto = airfoil(40), case(shifted)
    turned = sv.Rotate("airfoil", 2.0)
    assert not motion_problems(onto.change(motions=(*onto.motions, turned)), mesh)
    (problem,) = motion_problems(onto.change(motions=(turned, *onto.motions)), mesh)
    assert "motion 2: it begins at the undeformed places of 'airfoil'" in str(problem)
    for limit in (-1.0, np.nan, np.inf):
        with pytest.raises(CaseError, match=f"the limit {limit:g} is not above 0; leave it out fo"):
            sv.Onto(shifted, "airfoil", limit)


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1000.0, "millimetres for metres"),
        (0.001, "metres for millimetres"),
        (39.37, "inches for metres"),
        (25.4, "millimetres for inches"),
        (1 / 25.4, "inches for millimetres"),
        (100.0, "centimetres for metres"),
        (10.0, "millimetres for centimetres"),
        (0.1, "centimetres for millimetres"),
    ],
)
def test_a_target_in_another_unit_says_so_first(factor, said, tmp_path):
    mesh = airfoil(40)
    sv.write(tmp_path / "other.su2", mesh.with_points(factor * mesh.points))
    with pytest.raises(CaseError) as found:
        next(sv.deform(case(tmp_path / "other.su2"), mesh))
    first = str(found.value).splitlines()[0]
    assert f"times as large as airfoil: {said}? Multiply its coordinates by" in first


def test_a_target_that_is_elsewhere_says_nothing_of_units(tmp_path):
    mesh = airfoil(40)
    sv.write(tmp_path / "other.su2", mesh.with_points(3.0 * mesh.points))
    with pytest.raises(CaseError) as found:
        next(sv.deform(case(tmp_path / "other.su2"), mesh))
    assert "times as large" not in str(found.value)
