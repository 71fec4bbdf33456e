"""Reading and writing the value of ``MOTION``: a pair of brackets for each motion of a marker.

``MOTION= (BLADE, translate, 0.1, 0.0) ; (BLADE, rotate, 5.0, centroid)``; all forms are in
``GRAMMAR``.
"""

from __future__ import annotations

from slideviz.case.motions.kinds import KIND_OF, KINDS
from slideviz.case.motions.motion import ALL_MOVING, Motion, Target
from slideviz.case.values import Kind
from slideviz.case.words import Words, is_none, words_of
from slideviz.errors import CaseError, Message, nearest, raise_all, shown


def read_motions(text: str) -> tuple[Motion, ...]:
    """Return the motions of the value of ``MOTION``; CaseError with a sentence for each mistake."""
    groups = _groups(words_of(text), text)
    if not [group for group in groups if group]:
        return ()
    motions: list[Motion] = []
    problems = list[Message]()
    for place, group in enumerate(groups, start=1):
        try:
            motions.append(_read_motion(group))
        except CaseError as problem:
            problems += problem.within(f"motion {place}")
    raise_all(problems)
    return tuple(motions)


def write_motions(motions: tuple[Motion, ...]) -> str:
    """Return the value of ``MOTION``, a line for each motion; CaseError if one has no such form."""
    return " ; \\\n    ".join(motion.text for motion in motions) or "( )"


def _groups(words: Words, text: str) -> list[Words]:
    """Return the words in each outer pair of brackets of ``text``, inner brackets as words."""
    groups: list[Words] = []
    depth = 0
    if is_none(words):
        return []
    for word in words:
        depth -= word.is_sign(")")
        if depth > 0:
            groups[-1].append(word)
        elif depth < 0 or not any(word.is_sign(sign) for sign in "();,"):
            raise CaseError(
                f"{shown(text)}: each motion needs a pair of brackets, e.g. "
                "(BLADE, translate, 0.1, 0.0) ; (TIP, rotate, 5, centroid)"
            )
        if word.is_sign("("):
            groups += [[]] if depth == 0 else []
            depth += 1
    if depth:
        raise CaseError(
            f"{shown(text)}: a bracket is not closed; a list that continues in the next line "
            f"needs a backslash at the end of its line"
        )
    return groups


def _read_motion(group: Words) -> Motion:
    items = [word for word in group if not word.is_sign(",")]
    if len(items) < 2:
        raise CaseError(f"expected a marker and one of {', '.join(KIND_OF)}")
    marker, items = _read_target(items)
    word = items[0].text if items else ""
    verb = word.lower()
    if verb not in KIND_OF:
        hint = nearest(verb, KIND_OF)
        raise CaseError(f"{shown(word)} is not one of {', '.join(KIND_OF)}{hint}")
    return KIND_OF[verb].read(marker, verb, items[1:])


def _read_target(items: Words) -> tuple[Target, Words]:
    head = items[0]
    if not head.is_sign("("):
        if not head.text or head.is_sign(")"):
            raise CaseError("it does not begin with the name of a marker")
        every = head.text == ALL_MOVING and not head.quoted
        return "" if every else head.text, items[1:]
    end = next(place for place, word in enumerate(items) if word.is_sign(")"))
    names = tuple(word.text for word in items[1:end])
    if not all(names) or not names or any(word.is_sign("(") for word in items[1:end]):
        raise CaseError("its first brackets are not a list of markers; write ((A, B), rotate, ...)")
    if len(set(names)) < len(names):
        raise CaseError(f"({', '.join(names)}) names a marker twice; name each once")
    return names if len(names) > 1 else names[0], items[end + 1 :]


GRAMMAR = (
    *(line for kind in KINDS for line in kind.grammar),
    "(*, VERB, ...)                                all moving boundaries, as one body",
    "((BLADE, TIP), VERB, ...)                     several, as one body; in a sweep: BLADE+TIP",
    "centroid: mean of the nodes of what is moved, where they are at that moment",
)
MOTIONS = Kind(
    "(MARKER, VERB, ...) ; (MARKER, VERB, ...)", read_motions, write_motions, details=GRAMMAR
)
