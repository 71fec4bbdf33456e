"""Swapped and wrong arguments of the public functions are refused in a sentence."""

import inspect
import re
from dataclasses import FrozenInstanceError, replace
from inspect import get_annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.argument_types import CheckedFields, annotations_of, frozen, record
from slideviz.case.motions.kinds import KINDS
from slideviz.design.sweeps.table import read_designs
from slideviz.errors import ArgumentError, MeshError
from tests import builders

MESH = builders.square(6)
CASE = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Translate("BLOCK", (0.02, 0.01)),), steps=1)
A_MESH, A_CASE = "expected a Mesh from slideviz.read", "expected a Case from slideviz.Case.read"
A_FILE = "expected the name of a file"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sv.deform("a"), f"deform(case, mesh): case is 'a'; {A_CASE}"),
        (lambda: sv.deform(MESH, CASE), f"deform(case, mesh): case is of type Mesh; {A_CASE}"),
        (lambda: sv.deform(CASE, mesh=None), f"deform(case, mesh): mesh is None; {A_MESH}"),
        (lambda: sv.Deformer(CASE, MESH), f"Deformer(mesh, case): mesh is of type Case; {A_MESH}"),
        (lambda: sv.quality("x" * 99), "quality(mesh): mesh is of type str; expected"),
        (lambda: sv.quality(MESH, "x"), f"quality(mesh): reference is 'x'; {A_MESH}"),
        (lambda: sv.sweep(MESH, {}), f"sweep(case, designs): case is of type Mesh; {A_CASE}"),
        (lambda: sv.sweep(CASE, {}, 3), "executor is 3; expected an executor of concurrent"),
        (lambda: sv.read(MESH), f"read(path): path is of type Mesh; {A_FILE}"),
        (lambda: sv.write(MESH, "a.su2"), f"write(path, mesh): path is of type Mesh; {A_FILE}"),
        (
            lambda: sv.convert("a.su2", MESH),
            f"convert(source, target): target is of type Mesh; {A_FILE}",
        ),
        (lambda: sv.Case.read(3), f"Case.read(path): path is 3; {A_FILE}"),
        (lambda: CASE.write(None), f"Case.write(path): path is None; {A_FILE}"),
    ],
)
def test_wrong_arguments_are_named(call, said):
    with pytest.raises(ArgumentError, match=re.escape(said)) as found:
        call()
    assert isinstance(found.value, sv.SlidevizError)
    assert isinstance(found.value, TypeError)


def test_right_arguments_pass_and_are_still_told_of():
    assert sv.quality(MESH, None).min == sv.quality(mesh=MESH, reference=MESH).min
    assert list(inspect.signature(sv.deform).parameters)[:2] == ["case", "mesh"]
    assert sv.deform.__doc__.startswith("Yield the deformed mesh")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: sv.sweep(CASE, 3),
            "designs is 3; expected the name of a CSV file, a sequence of",
        ),
        (lambda: sv.sweep(CASE, {"STEPS": 3}), "designs['STEPS'] is 3; expected a sequence of"),
        (lambda: sv.sweep(CASE, {3: [3]}), "a key of designs is 3; expected a text"),
        (lambda: CASE.change(roles={3: "moving"}), "a key of roles is 3; expected a text"),
        (lambda: sv.sweep(CASE, {"STEPS": [3]}, workers="2"), "workers is '2'; expected a whole"),
        (lambda: sv.Mesh("a", "b"), "Mesh: points is 'a'; expected an array of numbers"),
        (lambda: sv.Mesh(MESH.points, "b"), "Mesh: cells is 'b'; expected Cells"),
        (lambda: sv.Mesh(MESH.points, MESH.cells, ("a",)), "markers[0] is 'a'; expected Marker"),
        (lambda: sv.Marker(3, MESH.cells), "Marker: name is 3; expected a text"),
        (lambda: sv.Cells.from_types("a", [1]), "types is 'a'; expected an array of numbers"),
        (lambda: MESH.with_points("a"), "Mesh.with_points(points): points is 'a'; expected an"),
        (lambda: sv.deform(CASE, MESH, 3), "progress is 3; expected a function, or None"),
        (lambda: sv.Deformer(MESH, CASE, progress=3), "progress is 3; expected a function"),
        (lambda: sv.Deformer(MESH, CASE, "x"), "displacements is 'x'; expected an array of numb"),
        (lambda: sv.read("a", progress=3), "progress is 3; expected a function, or None"),
        (lambda: sv.read("a", file_format=3), "is 3; expected 'su2' or 'su2b', or None"),
        (
            lambda: sv.write("a.vtu", MESH, cell_data=[1]),
            "cell_data is [1]; expected a mapping of names to arrays of numbers, or None",
        ),
        (lambda: sv.write("a.vtu", MESH, cell_data={"q": "a"}), "cell_data['q'] is 'a'; expected"),
        (lambda: sv.quality(MESH).worst("a"), "Quality.worst(n): n is 'a'; expected a whole"),
        (lambda: sv.quality(MESH, metric=3), "metric is 3; expected 'knupp' or 'rbf-slide'"),
        (lambda: sv.Rotate("a", "5"), "Rotate: angle_deg is '5'; expected a number"),
        (lambda: sv.Rotate("a", True), "Rotate: angle_deg is True; expected a number"),
        (lambda: sv.Rotate("a", 5, "here"), "expected a tuple of numbers, or 'centroid'"),
        (lambda: sv.Scale("a", 1.05), "Scale: factors is 1.05; expected a tuple of numbers"),
        (lambda: sv.Translate("a", (1, "b")), "Translate: vector[1] is 'b'; expected a number"),
        (lambda: sv.Translate("a", {1.0}), "vector is of type set; expected a tuple of numbers"),
        (lambda: sv.Radial("a", factor="b"), "Radial: factor is 'b'; expected a number"),
        (lambda: sv.Ffd("a", "b", (1, 2), (1, 2, 3)), "index is (1, 2); expected 3 whole numbers"),
        (lambda: sv.FfdCamber("a", "b", (1, 2, 3), 1), "index is (1, 2, 3); expected 2 whole num"),
        (lambda: sv.FfdTwist("a", "b", 1.5, 3), "plane is 1.5; expected a whole number"),
        (lambda: sv.FromFile(3), "FromFile: path is 3; expected the name of a file"),
        (lambda: sv.Prescribed([0.5], [[1, 2]]), "nodes is [0.5]; expected an array of whole"),
        (lambda: sv.Prescribed([0, 1], [[1, 2], [3]]), "expected an array of numbers"),
        (lambda: sv.Reduction(tolerance="a"), "Reduction: tolerance is 'a'; expected a number"),
        (lambda: CASE.change(influence_factor="3"), "influence_factor is '3'; expected a number"),
        (lambda: CASE.change(steps=1.5), 'steps is 1.5; expected a whole number, or "auto"'),
        (lambda: CASE.change(generate_quality="NO"), "is 'NO'; expected True or False"),
        (
            lambda: CASE.change(roles=["A"]),
            """roles is ['A']; expected a role for each marker, e.g.""",
        ),
        (lambda: CASE.change(roles={"A": 3}), "roles['A'] is 3; expected 'moving' or 'fixed'"),
        (lambda: CASE.change(motions=CASE.motions[0]), "motions is of type Translate; expected a"),
        (lambda: CASE.change(motions=["up"]), "motions[0] is 'up'; expected a motion, e.g."),
        (lambda: CASE.change(reduction="NO"), "reduction is 'NO'; expected Reduction, or None"),
    ],
)
def test_values_of_another_type_are_told_at_once(call, said):
    with pytest.raises(ArgumentError, match=re.escape(said)):
        call()


def test_numbers_and_arrays_of_numpy_and_lists_fit():
    case = CASE.change(steps=np.int64(3), influence_factor=np.array(3), axis=np.eye(3)[2])
    assert (case.steps, case.influence_factor) == (3, 3)
    motions = [
        sv.Rotate("BLOCK", np.float32(2), [0, 0]),
        sv.Scale("BLOCK", np.array([2.0])),
        sv.Translate(["BLOCK"], [1, np.float64(2)]),
        sv.Prescribed([], np.empty((0, 2))),
    ]
    case = CASE.change(motions=motions, ffd_boxes=[["box", list(range(24))]], origin=[0, 1, 2])
    assert case.motions == tuple(motions)
    assert case.motions[1:3] == (sv.Scale("BLOCK", (2.0,)), sv.Translate(("BLOCK",), (1, 2.0)))
    assert (case.ffd_boxes, case.origin) == ((("box", tuple(range(24))),), (0, 1, 2))
    assert MESH.with_points(MESH.points.astype(object)).extent == MESH.extent
    assert MESH.with_points(MESH.points.tolist()).extent == MESH.extent
    designs = [{"STEPS": 1}]
    assert len(read_designs(CASE, iter(designs)).rows) == 1
    assert sv.sweep(CASE, iter(designs), mesh=MESH)
    assert sv.sweep(CASE, {"STEPS": np.arange(1, 3)}, mesh=MESH)


def test_every_motion_checks_its_fields_and_every_annotation_is_known():
    motions = (*KINDS, sv.Prescribed)
    assert all(issubclass(kind, CheckedFields) for kind in motions)
    for kind in (*motions, sv.Case, sv.Reduction):
        assert {*kind.__dataclass_fields__} <= {*annotations_of(kind)}
    functions = sv.read, sv.write, sv.convert, sv.deform, sv.quality, sv.sweep, sv.Deformer.__init__
    for function in functions:
        inner = function.__wrapped__
        assert set(annotations_of(inner)) == set(get_annotations(inner))


def test_names_of_files_in_a_case_may_be_texts(tmp_path):
    case = CASE.change(mesh_file=str(tmp_path / "a.su2"))
    case.write(tmp_path / "a.cfg")
    assert sv.Case.read(tmp_path / "a.cfg").mesh_file == case.mesh_file == tmp_path / "a.su2"


def test_motions_may_be_a_list(tmp_path):
    case = CASE.change(motions=list(CASE.motions))
    assert case == CASE
    case.write(tmp_path / "a.cfg")


def test_texts_that_are_no_format_are_named():
    for call in (
        lambda: sv.read("a", file_format="x"),
        lambda: sv.write("a", MESH, file_format="x"),
    ):
        with pytest.raises(MeshError, match=r"a: file_format 'x' is not one of su2 \| su2b"):
            call()


def test_a_record_is_frozen_and_equal_only_to_itself():
    @record
    class Pair:
        one: int
        two: int = 2

    pair = Pair(1)
    assert pair == pair != Pair(1)
    assert {pair: 3}[pair] == 3
    assert repr(replace(pair, one=3)).endswith("Pair(one=3, two=2)")
    with pytest.raises(FrozenInstanceError):
        pair.one = 2


def test_a_frozen_value_is_equal_where_its_fields_are():
    @frozen
    class Pair:
        one: int
        two: int = 2

    pair = Pair(1)
    assert pair == Pair(1) != replace(pair, one=3)
    assert {pair: 3}[Pair(1)] == 3
    with pytest.raises(FrozenInstanceError):
        pair.one = 2
