"""The combinations of a comparison, those ruled out by case or mesh, and words for both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product

from slideviz.case.check import check_case
from slideviz.case.model import Case
from slideviz.mesh.model import Mesh
from slideviz.study.combinations import COMPARED_METHODS, MODES, Combination
from slideviz.terms import SLIDING, PeriodicMode

Names = tuple[Callable[[str], str], Callable[[str], str]]
"""Functions that return the name of a method and of a periodic mode."""

KEYS: Names = (lambda method: f"method {method}", lambda mode: f"periodic {mode}")
"""Names as in the options of the command."""

TITLES: Names = (lambda method: COMPARED_METHODS[method][0], lambda mode: MODES[mode])
"""Names as in figures."""


def combinations(
    methods: Sequence[str], modes: Sequence[PeriodicMode], steps: Sequence[int]
) -> tuple[Combination, ...]:
    """Return all combinations; those of one method and mode, which share a setup, are adjacent."""
    return tuple(Combination(*row) for row in product(methods, modes, steps))


def wanted_modes(case: Case) -> tuple[PeriodicMode, ...]:
    """Return the modes that are compared by default: the case's own, and with ``moving`` ``fixed``.

    For ``moving`` is not possible without sliding.
    """
    return ("fixed", "moving") if case.periodic == "moving" else (case.periodic,)


def wanted_methods(case: Case) -> tuple[str, ...]:
    """Return the methods compared by default: all of SLIDING_MODE, or ``none`` without sliding."""
    slides = any(case.markers_with(role) for role in ("sliding", "periodic", "internal"))
    return tuple(SLIDING) if slides else ("none",)


def refused(case: Case, mesh: Mesh, wanted: Iterable[Combination]) -> dict[Combination, str]:
    """Return the combinations that contradict the case or the mesh, each with the reason.

    Nothing is deformed: other combinations may turn out to be impossible later.
    """
    problems: dict[tuple[str, str], str] = {}
    found = {}
    for one in wanted:
        kind = one.method, one.periodic
        if kind not in problems:
            problems[kind] = "; ".join(dict.fromkeys(check_case(one.applied(case), mesh)))
        if problems[kind]:
            found[one] = problems[kind]
    return found


def reasons(problems: Mapping[Combination, str]) -> dict[str, list[Combination]]:
    """Return for each reason the combinations that have it."""
    found: dict[str, list[Combination]] = {}
    for combination, problem in problems.items():
        found.setdefault(" ".join(problem.split()), []).append(combination)
    return found


def words_for(some: Iterable[Combination], every: Iterable[Combination], names: Names) -> str:
    """Return words for ``some`` of ``every`` combination, whatever their numbers of steps.

    A mode with all methods is named by the mode only, a method with all modes by the method only.
    """
    pairs = dict.fromkeys((one.method, one.periodic) for one in some)
    others = {(one.method, one.periodic) for one in every} - pairs.keys()
    spoilt = [{pair[axis] for pair in others} for axis in (0, 1)]
    words: dict[str, None] = {}
    for method, mode in pairs:
        if mode not in spoilt[1]:
            words[names[1](mode)] = None
        elif method not in spoilt[0]:
            words[names[0](method)] = None
        else:
            words[f"{names[0](method)} with {names[1](mode)}"] = None
    return "; ".join(words)


def announcement(
    wanted: Sequence[Combination],
    cannot: Mapping[Combination, str],
    more: Mapping[str, Sequence[str]],
) -> str:
    """Return lines about the work of a comparison, before it begins.

    Parameters
    ----------
    wanted : sequence of Combination
    cannot : mapping of Combination to str
        Those that are left out, with the reason; see `refused`.
    more : mapping of str to sequence of str
        Further values that each option (``methods``, ``periodic``) takes; empty where the user has
        chosen.
    """
    tried: dict[str, Iterable[str]] = {
        "methods": dict.fromkeys(one.method for one in wanted),
        "periodic": dict.fromkeys(one.periodic for one in wanted),
        "steps": dict.fromkeys(str(one.steps or "auto") for one in wanted),
    }
    count = len(wanted) - len(cannot)
    lines = [f"{count} combination{'' if count == 1 else 's'}"]
    for option, values in tried.items():
        also = [value for value in more.get(option, ()) if value not in values]
        hint = f"   (--{option} takes {', '.join(also)}, too)" if also else ""
        lines.append(f"  {option:<8}  {', '.join(values)}{hint}")
    for problem, left_out in reasons(cannot).items():
        lines.append(f"  left out  {words_for(left_out, wanted, KEYS)}: {problem}")
    return "\n".join(lines)
