"""Keys of a case file about periodicity."""

from __future__ import annotations

from slideviz.case.key import PERIODICITY, Key, setting
from slideviz.case.model import Case
from slideviz.case.values import AXIS, POINT, choice, one_of
from slideviz.errors import CaseError
from slideviz.terms import PERIODIC_DIRECTIONS, PERIODIC_MODES, PERIODIC_TYPES


def no_pair(case: Case) -> str:
    """Return why settings of periodicity have no effect in a case; "" where they have one."""
    return "" if "periodic" in case.roles.values() else "no boundary has the role “periodic”"


def put_direction(case: Case, word: str) -> Case:
    """Return the case with the direction of a word, and the type of periodicity that it implies.

    Raises
    ------
    CaseError
        The case has another type of periodicity.
    """
    direction, implied = PERIODIC_DIRECTIONS[word]
    if implied is not None and case.periodic_type not in ("auto", implied):
        raise CaseError(
            f"{word} is a direction of {implied} periodicity, and PERIODIC_TYPE= "
            f"{case.periodic_type}; change one of the two"
        )
    return case.change(direction=direction, periodic_type=implied or case.periodic_type)


def get_direction(case: Case) -> str | None:
    """Return the number of the direction as text, None if the case has none."""
    return None if case.direction is None else str(case.direction)


PERIODIC_ROWS = (
    setting(
        "PERIODIC_MODE",
        PERIODICITY,
        one_of(PERIODIC_MODES),
        "periodic",
        "How boundaries repeat: not, in the distance only, or also in the displacement with "
        "fixed or moving vertices.",
        label="Periodicity",
        form="main",
        tip="What the periodic boundaries do: nothing special (none), only the distance repeats "
        "(periodic), or both sides deform alike with the corners of the domain held (fixed "
        "vertices) or sliding along (moving vertices).",
        run_label="",
        idle_reason=no_pair,
    ),
    setting(
        "PERIODIC_TYPE",
        PERIODICITY,
        one_of(PERIODIC_TYPES, {"0": "translational", "1": "rotational"}),
        "periodic_type",
        "Shift (0) or rotation (1); auto finds out by matching the markers.",
        label="Type",
        form="main",
        tip="Whether one side is the other one shifted or turned; automatic takes what matches.",
        run_label="{} type",
        idle_reason=no_pair,
    ),
    Key(
        "PERIODIC_DIRECTION",
        PERIODICITY,
        choice({word: word for word in PERIODIC_DIRECTIONS}),
        "Without effect, but that x, y, r and theta imply PERIODIC_TYPE: the direction (0, 1, 2 "
        "for x, y, z or r, theta, z) is found by matching the markers.",
        put_direction,
        get_direction,
        field="direction",
        run_label="",
        no_effect="matching the periodic markers finds the direction",
    ),
    setting(
        "PERIODIC_AXIS",
        PERIODICITY,
        AXIS,
        "axis",
        "Axis of rotational periodicity.",
        label="Axis",
        form="main",
        tip="The axis that the mesh repeats about, for rotational periodicity.",
        idle_reason=no_pair,
    ),
    setting(
        "PERIODIC_ORIGIN",
        PERIODICITY,
        POINT,
        "origin",
        "A point on that axis.",
        label="Through",
        form="main",
        run_label="axis through {}",
        idle_reason=no_pair,
    ),
)
