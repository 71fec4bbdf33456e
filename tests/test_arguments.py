"""Swapped and wrong arguments of the public functions are refused in a sentence."""

import inspect
import re

import pytest

import slideviz as sv
from slideviz.errors import ArgumentError, CaseError, MeshError
from tests import builders

MESH = builders.square(6)
CASE = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Translate("BLOCK", (0.02, 0.01)),), steps=1)
A_MESH, A_CASE = "needed is a Mesh, as slideviz.read", "needed is a Case, as slideviz.Case.read"
A_FILE = "needed is the name of a file"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sv.deform("a"), f"deform(case, mesh): case is 'a'; {A_CASE}"),
        (lambda: sv.deform(MESH, CASE), f"deform(case, mesh): case is of type Mesh; {A_CASE}"),
        (lambda: sv.deform(CASE, mesh=None), f"deform(case, mesh): mesh is None; {A_MESH}"),
        (lambda: sv.Deformer(CASE, MESH), f"Deformer(mesh, case): mesh is of type Case; {A_MESH}"),
        (lambda: sv.quality("x" * 99), "quality(mesh, reference): mesh is of type str; needed"),
        (lambda: sv.quality(MESH, "x"), f"quality(mesh, reference): reference is 'x'; {A_MESH}"),
        (lambda: sv.sweep(MESH, {}), f"mesh): case is of type Mesh; {A_CASE}"),
        (lambda: sv.sweep(CASE, {}, 3), "executor is 3; needed is an executor of concurrent"),
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
    ("values", "said"),
    [
        ({"roles": ["A"]}, """roles is ['A']; needed is a role for each marker, as {"blade": """),
        ({"motions": CASE.motions[0]}, "motions is Translate(marker='BLOCK', vector=(0.02, 0.01))"),
        ({"motions": ["up"]}, "motions: 'up' is none, as Translate(...) is"),
        ({"reduction": "NO"}, "reduction is 'NO'; needed is a Reduction, or None"),
    ],
)
def test_values_of_another_type_are_refused_by_a_case(values, said):
    with pytest.raises(CaseError, match=re.escape(said)):
        CASE.change(**values)


def test_motions_may_be_a_list(tmp_path):
    case = CASE.change(motions=list(CASE.motions))
    assert case == CASE
    case.write(tmp_path / "a.cfg")


def test_numbers_that_are_none_are_named():
    with pytest.raises(CaseError, match="motion 1: 'int' object is not iterable"):
        next(sv.deform(CASE.change(motions=(sv.Translate("BLOCK", 3),)), MESH))
    with pytest.raises(CaseError, match="displacements is no table of numbers: could not convert"):
        sv.Deformer(MESH, CASE, "x")
    for call in (
        lambda: sv.read("a", file_format="x"),
        lambda: sv.write("a", MESH, file_format="x"),
    ):
        with pytest.raises(MeshError, match=r"a: file_format 'x' is not one of su2 \| su2b"):
            call()
