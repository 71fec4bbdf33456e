"""The tables of all enumerations: complete, in words, and loaded without anything else."""

import subprocess
import sys
from typing import get_args

import pytest

from slideviz import terms

TABLES = [
    (terms.FileFormat, terms.FILE_FORMATS),
    (terms.Role, terms.ROLES),
    (terms.NodeType, terms.NODE_TYPES),
    (terms.SpanKind, terms.SPAN_KINDS),
    (terms.Side, terms.SIDES),
    (terms.FfdBlending, terms.FFD_BLENDINGS),
    (terms.FfdSystem, terms.FFD_SYSTEMS),
    (terms.Sliding, terms.SLIDING),
    (terms.Method, terms.METHODS),
    (terms.StiffnessType, terms.STIFFNESS_TYPES),
    (terms.Polynomial, terms.POLYNOMIALS),
    (terms.Selection, terms.SELECTIONS),
    (terms.DataReduction, terms.DATA_REDUCTIONS),
    (terms.Relax, terms.RELAXES),
    (terms.Rims, terms.RIMS),
    (terms.Repair, terms.REPAIRS),
    (terms.RepairTarget, terms.REPAIR_TARGETS),
    (terms.Layers, terms.LAYERS),
    (terms.LevelCriterion, terms.LEVEL_CRITERIA),
    (terms.PeriodicMode, terms.PERIODIC_MODES),
    (terms.PeriodicType, terms.PERIODIC_TYPES),
    (terms.Metric, terms.METRICS),
    (terms.WallValue, terms.WALL_VALUES),
    (terms.SkewMetric, terms.SKEW_METRICS),
    (terms.CellState, dict.fromkeys(terms.CELL_STATES, terms.Term("state"))),
    (terms.Quantity, terms.QUANTITIES),
    (terms.ColorBy, terms.COLOR_BY),
    (terms.ColorMap, terms.COLOR_MAPS),
    (terms.PointsShown, terms.POINTS_SHOWN),
    (terms.Shown, terms.SHOWN),
]


@pytest.mark.parametrize(("kind", "table"), TABLES, ids=str)
def test_the_type_has_the_values_of_the_table_in_its_order(kind, table):
    assert get_args(kind) == tuple(table)
    assert all(term.label and term.name for term in table.values())


def test_what_is_drawn_in_colors_has_one_of_its_own_for_each_value():
    for table in (terms.ROLES, terms.NODE_TYPES):
        colors = [term.color for term in table.values()]
        assert all(len(bytes.fromhex(color.removeprefix("#"))) == 3 for color in colors)
        assert len(set(colors)) == len(colors)


def test_each_list_in_which_one_chooses_has_words_that_differ():
    for kind, table in TABLES:
        if kind is not terms.CellState:
            assert len(set(terms.labels(table).values())) == len(table)
            assert len(set(terms.names(table).values())) == len(table)


def test_only_what_has_a_tip_is_explained():
    assert set(terms.tips(terms.SLIDING)) == set(terms.SLIDING)
    assert not terms.tips(terms.PERIODIC_TYPES)


def test_each_value_has_what_computes_or_draws_it():
    from matplotlib import colormaps

    from slideviz.mesh import skew
    from slideviz.rbf import methods
    from slideviz.study.combinations import COMPARED_METHODS

    assert methods.SLIDING_METHODS.keys() == terms.SLIDING.keys()
    assert skew.SKEW_METRICS.keys() == terms.SKEW_METRICS.keys()
    assert set(terms.COLOR_MAPS) <= set(colormaps)
    assert set(COMPARED_METHODS) == {*terms.SLIDING, *terms.METHODS} - {"rbf"}


def test_it_loads_nothing_of_slideviz_and_no_numpy():
    code = "import sys, slideviz.terms; print(*sys.modules)"
    call = [sys.executable, "-c", code]
    found = subprocess.run(call, capture_output=True, text=True, check=True).stdout.split()
    assert [name for name in found if name.startswith(("slideviz", "numpy"))] == [
        "slideviz",
        "slideviz.terms",
    ]
