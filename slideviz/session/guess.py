"""Roles guessed from the names of boundaries and from boundaries that match each other."""

from __future__ import annotations

import re
from collections.abc import Sequence

from slideviz.case.model import Case
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import Pair
from slideviz.session.state import Guess
from slideviz.terms import Role

NAMES: tuple[tuple[Role, str], ...] = (
    ("periodic", r"per|period|periodic|cyclic|pitchwise"),
    ("moving", r"airfoil|aerofoil|foil|profile|blade|vane|wing|naca\d*|cylinder"),
    ("sliding", r"hub|shroud|casing|endwall|sidewall|sym|symm|symmetry"),
    ("sliding", r"inflow|inlet|outflow|outlet|exit|in|out|interface"),
    ("moving", r"rotor|stator"),
    ("fixed", r"walls?|far|farfield|freestream|upper|lower|left|right|top|bottom|front|back"),
)
"""A role and the words that hint at it, the first row that fits wins."""

_WORDS = tuple((role, re.compile(pattern)) for role, pattern in NAMES)


def guess_by_name(name: str) -> Guess | None:
    """Return the role that the words of a boundary's name hint at, or None."""
    # "Periodic1", "inflow_2" and "FLUID_INLET" all end up as words in lower case.
    parts = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    words = [word for word in re.split(r"[^a-z]+|(?<=[a-z])(?=\d)", parts.lower()) if word]
    whole = [re.sub(r"[^a-z]", "", name.lower())]
    for role, pattern in _WORDS:
        for word in words + whole:
            if pattern.fullmatch(word):
                return Guess(role, f"its name says “{word}”")
    return None


def guess_roles(mesh: Mesh, pairs: Sequence[Pair] = ()) -> dict[str, Guess]:
    """Return a guess for each boundary that gives a hint, in the order of the mesh.

    The name comes first, because the opposite sides of every box match each other; a match
    decides only where neither name says anything.
    """
    guesses = {name: found for name in mesh.marker_names if (found := guess_by_name(name))}
    for pair in pairs:
        ends = (pair.first, pair.second)
        named = [guesses[name].role for name in ends if name in guesses]
        if named and set(named) != {"periodic"}:
            continue
        for name, other in (ends, ends[::-1]):
            guesses[name] = Guess("periodic", f"it matches {other}: {pair.describe()}")
    return {name: guesses[name] for name in mesh.marker_names if name in guesses}


def guess_case(mesh: Mesh, guesses: dict[str, Guess], pairs: Sequence[Pair]) -> Case:
    """Return a case with the guessed roles, periodic when a pair of periodic boundaries matches."""
    roles = {name: guesses[name].role if name in guesses else "fixed" for name in mesh.marker_names}
    case = Case(roles=roles, zone=mesh.zone if mesh.zones > 1 else None)
    if "sliding" in roles.values():
        # A role that the method does not use would be no help.
        case = case.change(sliding="ps", steps=5)
    for pair in pairs:
        if roles[pair.first] == roles[pair.second] == "periodic":
            return with_periodicity(case, pair)
    return case


def with_periodicity(case: Case, pair: Pair | None) -> Case:
    """Return the case with what repeats deformed alike, about the axis of a pair if there is one.

    The corners of the domain slide along where anything slides.
    """
    case = case.change(periodic="fixed" if case.sliding == "none" else "moving")
    return case if pair is None else case.change(axis=pair.axis, origin=pair.origin)
