"""Reading and writing the value of ``MOTION``: a pair of brackets for each motion of a marker.

``MOTION= (BLADE, translate, 0.1, 0.0) ; (BLADE, rotate, 5.0, centroid)``; all forms are in
``GRAMMAR``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from slideviz.case import model
from slideviz.case.model import Motion, Point, Target, named
from slideviz.case.values import Kind, axis_text, path_text, read_axis, read_vector, vector_text
from slideviz.case.words import Word, counted, is_none, name_text, number, words_of
from slideviz.errors import CaseError, nearest, not_one_of, shown
from slideviz.terms import MOTION_KINDS, SIDES, SPAN_KINDS, SpanKind

VERBS = (*(kind for kind in MOTION_KINDS if kind != "span"), *SPAN_KINDS)
VERB_OF: dict[type, str] = {
    model.Translate: "translate",
    model.Rotate: "rotate",
    model.Scale: "scale",
    model.Radial: "radial",
    model.HicksHenne: "hicks-henne",
    model.Cst: "cst",
    model.Bump: "bump",
    model.Ffd: "ffd",
    model.FfdCamber: "ffd-camber",
    model.FfdThickness: "ffd-thickness",
    model.FfdTwist: "ffd-twist",
    model.SpanMotion: "span",
    model.FromFile: "file",
    model.Onto: "onto",
}
"""Verbs of motions, by class; those of `SpanMotion` are its kinds."""
ALL_MOVING = "*"
MOST_TERMS = 100  # most terms of an airfoil's shape function


def read_motions(text: str) -> tuple[Motion, ...]:
    """Return the motions of the value of ``MOTION``; CaseError with a sentence for each mistake."""
    groups = _groups(words_of(text), text)
    if not [group for group in groups if group]:
        return ()
    motions: list[Motion] = []
    problems = []
    for place, group in enumerate(groups, start=1):
        try:
            motions.append(_read_motion(group))
        except CaseError as problem:
            problems.append(f"motion {place}: {problem}")
    if problems:
        raise CaseError("\n".join(problems))
    return tuple(motions)


def write_motions(motions: tuple[Motion, ...]) -> str:
    """Return the value of ``MOTION``, a line for each motion; CaseError if one has no such form."""
    return " ; \\\n    ".join(_motion_text(motion) for motion in motions) or "( )"


def _groups(words: list[Word], text: str) -> list[list[Word]]:
    """Return the words in each outer pair of brackets of ``text``, inner brackets as words."""
    groups: list[list[Word]] = []
    depth = 0
    if is_none(words):
        return []
    for word in words:
        depth -= word.is_sign(")")
        if depth > 0:
            groups[-1].append(word)
        elif depth < 0 or not any(word.is_sign(sign) for sign in "();,"):
            raise CaseError(
                f"{shown(text)}: each motion needs a pair of brackets, as in "
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


def _read_motion(group: list[Word]) -> Motion:
    items = [word for word in group if not word.is_sign(",")]
    if len(items) < 2:
        raise CaseError(f"expected a marker and one of {', '.join(VERBS)}")
    marker, items = _read_target(items)
    word = items[0].text if items else ""
    verb, remaining = word.lower(), items[1:]
    if verb not in VERBS:
        hint = nearest(verb, VERBS)
        raise CaseError(f"{shown(word)} is not one of {', '.join(VERBS)}{hint}")
    return _READERS[verb](marker, remaining)


def _read_target(items: list[Word]) -> tuple[Target, list[Word]]:
    head = items[0]
    if not head.is_sign("("):
        if not head.text or head.is_sign(")"):
            raise CaseError("it does not begin with the name of a marker")
        every = head.text == ALL_MOVING and not head.quoted
        return "" if every else head.text, items[1:]
    end = next(place for place, word in enumerate(items) if word.is_sign(")"))
    names = tuple(word.text for word in items[1:end])
    if not all(names) or not names or any(word.is_sign("(") for word in items[1:end]):
        raise CaseError("its first brackets are no list of markers; write ((A, B), rotate, ...)")
    if len(set(names)) < len(names):
        raise CaseError(f"({', '.join(names)}) names a marker twice; name each once")
    return names if len(names) > 1 else names[0], items[end + 1 :]


def _read_file(marker: Target, rest: list[Word]) -> model.FromFile:
    if len(rest) != 1 or not rest[0].text:
        raise CaseError(
            "expected (MARKER, file, path); a path with spaces, commas or brackets needs quotes"
        )
    return model.FromFile(Path(rest[0].text.replace("\\", "/")), marker)


def _read_onto(marker: Target, rest: list[Word]) -> model.Onto:
    if len(rest) not in (1, 2) or not rest[0].text:
        raise CaseError(
            "expected (MARKER, onto, path) or (MARKER, onto, path, limit), where the limit is the "
            "largest distance that may remain; a path with spaces, commas or brackets needs quotes"
        )
    limit = number(rest[1].text) if rest[1:] else 0.0
    if limit < 0.0 or (rest[1:] and not limit):
        raise CaseError(f"the limit {limit:g} is not above 0; leave it out for 1 % of the size")
    return model.Onto(_read_file(marker, rest[:1]).path, marker, limit)


def _flat(words: list[Word]) -> list[Word]:
    return [word for word in words if not (word.is_sign("(") or word.is_sign(")"))]


def _is_centroid(word: Word) -> bool:
    return not word.quoted and word.text.lower() == "centroid"


def _read_rotate(marker: Target, rest: list[Word]) -> model.Rotate:
    items = _flat(rest)
    if not items:
        raise CaseError("the angle is missing; write rotate, angle in degrees, centroid")
    angle, items = number(items[0].text), items[1:]
    at_centroid = bool(items) and _is_centroid(items[-1])
    # The axis: a letter or three numbers, if more follows than a point in the plane.
    letter = bool(items) and items[0].text.lower() in ("x", "y", "z")
    n_axis = 1 if letter else 3 if len(items) > 3 else 0
    place = items[n_axis:]
    allowed = (1,) if at_centroid else (2, 3) if n_axis else (2,)
    if len(place) not in allowed:
        raise CaseError(
            "expected after the angle: the axis (x, y, z or three numbers; not in 2D) and then "
            "centroid or the point"
        )
    axis = read_axis(items[:n_axis]) if n_axis else (0.0, 0.0, 1.0)
    point: Point = "centroid" if at_centroid else read_vector(place, "the point")
    return model.Rotate(marker, angle, point, axis)


def _read_scale(marker: Target, rest: list[Word]) -> model.Scale:
    items = _flat(rest)
    if items and _is_centroid(items[-1]):
        factors, place = items[:-1], []
    else:
        opened = [i for i, word in enumerate(rest) if word.is_sign("(")]
        if opened and rest[-1].is_sign(")"):
            n_factors = len(_flat(rest[: opened[-1]]))
        else:
            n_factors = {3: 1, 6: 3}.get(len(items), 0)
        factors, place = items[:n_factors], items[n_factors:]
        if len(place) not in (2, 3):
            raise CaseError(
                "expected one factor or one for each axis, then centroid or the point; put the "
                "point in brackets: scale, 1.1, (0, 0, 0)"
            )
    if len(factors) not in (1, 2, 3):
        raise CaseError(f"{len(factors)} factors are given; expected one, or one for each axis")
    values = tuple(number(word.text) for word in factors)
    if min(values) <= 0.0:
        raise CaseError(f"the factor {min(values):g} is not above 0: it would fold the marker")
    return model.Scale(marker, values, read_vector(place, "the point") if place else "centroid")


def _read_radial(marker: Target, rest: list[Word]) -> model.Radial:
    items = _flat(rest)
    letter = len(items) > 2 and items[2].text.lower() in ("x", "y", "z")
    n_axis = 1 if letter else 3 if len(items) > 5 else 0
    place = items[2 + n_axis :]
    if len(items) < 4 or len(place) != (3 if n_axis else 2):
        raise CaseError(
            "expected the factor of the radius, the distance, the axis (x, y, z or three "
            "numbers) and a point on it; in 2D no axis: radial, 1.03, 0, z, (0, 0, 0)"
        )
    factor, distance = number(items[0].text), number(items[1].text)
    if factor <= 0.0:
        raise CaseError(f"the factor {factor:g} is not above 0: it would fold the marker")
    axis = read_axis(items[2 : 2 + n_axis]) if n_axis else (0.0, 0.0, 1.0)
    return model.Radial(marker, factor, distance, axis, read_vector(place, "the point"))


def _read_ffd(marker: Target, rest: list[Word]) -> model.Ffd:
    items = _flat(rest)
    name = items[0].text if items else ""
    if len(items) not in (5, 7) or not name:
        raise CaseError(
            "expected the box, the control point i, j, k (-1 is all of a direction) and its "
            "shift: ffd, BOX, 2, 1, 0, dx, dy, dz; in 2D ffd, BOX, 2, 1, dx, dy will do"
        )
    count = (len(items) - 1) // 2
    i, j, k = (*_integers(items[1 : 1 + count]), -1)[:3]
    dx, dy, dz = (*(number(word.text) for word in items[1 + count :]), 0.0)[:3]
    return model.Ffd(marker, name, (i, j, k), (dx, dy, dz))


_BUMPS = {
    "hicks-henne": "hicks-henne, upper, peak, height, or besides x0, x1 of the chord",
    "cst": "cst, upper, k, n, height, or besides x0, x1 of the chord",
    "bump": "bump, peak, height, x0, x1",
}


def _read_bump(verb: str, marker: Target, rest: list[Word]) -> model.OnAirfoil:
    words = _flat(rest)
    sided = verb != "bump"
    numbers = [number(word.text) for word in words[sided:]]
    before = 3 if verb == "cst" else 2
    if len(numbers) not in ((before, before + 2) if sided else (4,)):
        given = next((word.text for word in words[:1] if word.text.lower() in SIDES), "upper")
        hint = "; decimals are written with a point" if len(numbers) > 2 else ""
        raise CaseError(
            f"{counted(len(numbers), 'number')} given; expected "
            f"{_BUMPS[verb].replace('upper', given)}{hint}"
        )
    low, high = (*numbers[before:], 0.0, 1.0)[:2]
    if not low < high:
        raise CaseError(f"the chord goes from x = {low:g} to {high:g}; give the lower one first")
    *shape, height = numbers[:before]
    if verb != "cst":
        require_peak(shape[0])
    if verb == "bump":
        return model.Bump(marker, height, shape[0], (low, high))
    side = next((one for one in SIDES if one == words[0].text.lower()), None)
    if side is None:
        raise CaseError(not_one_of(words[0].text, SIDES))
    if verb == "cst":
        return model.Cst(marker, height, term_of(*shape), side, (low, high))
    return model.HicksHenne(marker, height, shape[0], side, (low, high))


def require_peak(peak: float) -> None:
    """Raise CaseError where a bump cannot have its peak at x = ``peak`` of a chord."""
    if not 0.0 < peak < 1.0:
        raise CaseError(f"the peak is at x = {peak:g}; it must lie between 0 and 1")


def term_of(k: float, n: float) -> tuple[int, int]:
    """Return term k of n of an airfoil's shape as integers; raises CaseError if there is none."""
    if k != int(k) or n != int(n) or not 1 <= k <= n <= MOST_TERMS:
        raise CaseError(
            f"there is no term {k:g} of {n:g}; expected whole numbers, 1 to n of n, and n up to "
            f"{MOST_TERMS}"
        )
    return int(k), int(n)


def _read_column(
    kind: type[model.FfdCamber | model.FfdThickness], marker: Target, rest: list[Word]
) -> model.FfdCamber | model.FfdThickness:
    items = _flat(rest)
    name = items[0].text if items else ""
    if len(items) not in (3, 4) or not name:
        raise CaseError(
            "expected the box, the column of control points i, j (-1 is all of a direction) and "
            f"the amount: {VERB_OF[kind]}, BOX, 2, 1, 0.01; in 2D {VERB_OF[kind]}, BOX, 2, 0.01"
        )
    i, j = (*_integers(items[1:-1]), -1)[:2]
    return kind(marker, name, (i, j), number(items[-1].text))


def _read_twist(marker: Target, rest: list[Word]) -> model.FfdTwist:
    items = _flat(rest)
    letter = len(items) > 3 and items[3].text.lower() in ("x", "y", "z")
    n_axis = 1 if letter else 3
    if len(items) != 6 + n_axis or not items[0].text:
        raise CaseError(
            "expected the box, the plane j of control points (-1 is all), the angle in degrees, "
            "the axis (x, y, z or three numbers) and a point on it: ffd-twist, BOX, 2, 5.0, y, "
            "0.25, 0, 0"
        )
    (plane,) = _integers(items[1:2])
    axis, point = read_axis(items[3 : 3 + n_axis]), read_vector(items[3 + n_axis :], "the point")
    return model.FfdTwist(marker, items[0].text, plane, number(items[2].text), point, axis)


def _read_span(kind: SpanKind, marker: Target, rest: list[Word]) -> model.SpanMotion:
    start = next((place for place, word in enumerate(rest) if word.is_sign("(")), len(rest))
    point = _flat(rest[start:])
    if point and len(point) != 3:
        raise CaseError("the point of the stacking line needs three coordinates: (x, y, z)")
    at = read_vector(point, "the stacking point") if point else None
    curve = read_curve(" ".join(word.text for word in rest[:start]))
    return model.SpanMotion(marker, kind, *curve, at)  # type: ignore[arg-type]


def read_curve(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return spans and values of a curve as ``0:0, 0.5:1.5, 1:4``, or of a single value.

    Raises CaseError with a sentence.
    """
    words = text.replace(",", " ").split()
    if len(words) == 1 and ":" not in text:
        return (0.0,), (number(words[0]),)
    if not words or any(word.count(":") != 1 for word in words):
        raise CaseError(
            f"{shown(text)} is no curve over the span; expected span:value, as in 0:0, 0.5:1.5, "
            "1:4, or a single value"
        )
    spans, values = zip(*(word.split(":") for word in words), strict=True)
    return tuple(map(number, spans)), tuple(map(number, values))


def curve_text(motion: model.SpanMotion) -> str:
    """Return the curve of a motion over the span as text, as `read_curve` reads it."""
    spans, values = (
        [repr(float(one)).removesuffix(".0") for one in several]
        for several in (motion.spans, motion.values)
    )
    if motion.spans == (0.0,):
        return values[0]
    return ", ".join(f"{span}:{value}" for span, value in zip(spans, values, strict=True))


def _integers(words: list[Word]) -> list[int]:
    at = [number(word.text) for word in words]
    if any(value != int(value) or value < -1 for value in at):
        text = ", ".join(word.text for word in words)
        raise CaseError(f"the control point ({text}) is none; expected whole numbers from -1")
    return [int(value) for value in at]


_READERS: dict[str, Callable[[Target, list[Word]], Motion]] = {
    "translate": lambda marker, rest: model.Translate(
        marker, read_vector(_flat(rest), "the shift")
    ),
    "rotate": _read_rotate,
    "scale": _read_scale,
    "radial": _read_radial,
    **{verb: partial(_read_bump, verb) for verb in _BUMPS},
    "ffd": _read_ffd,
    "ffd-camber": partial(_read_column, model.FfdCamber),
    "ffd-thickness": partial(_read_column, model.FfdThickness),
    "ffd-twist": _read_twist,
    **{kind: partial(_read_span, kind) for kind in SPAN_KINDS},
    "file": _read_file,
    "onto": _read_onto,
}


def _motion_text(motion: Motion) -> str:
    verb = motion.kind if isinstance(motion, model.SpanMotion) else VERB_OF.get(type(motion), "")
    return f"({', '.join([_target_text(motion.marker), verb, *_arguments(motion)])})"


def _arguments(motion: Motion) -> list[str]:
    """Return the texts that follow the verb of a motion; CaseError if it has none."""
    if isinstance(motion, model.Prescribed):
        raise CaseError(
            "displacements that a program gave cannot be written to a case file; write them to a "
            "displacement file"
        )
    if isinstance(motion, model.Translate):
        return _numbers(*motion.vector)
    if isinstance(motion, model.Bump):
        return _numbers(motion.peak, motion.height, *motion.chord)
    if isinstance(motion, model.OnAirfoil):
        chord = () if motion.chord == (0.0, 1.0) else motion.chord
        if isinstance(motion, model.Cst):
            return [motion.side, *map(str, motion.term), *_numbers(motion.height, *chord)]
        return [motion.side, *_numbers(motion.peak, motion.height, *chord)]
    if isinstance(motion, model.FfdTwist):
        turn = [*_numbers(motion.angle_deg), axis_text(motion.axis), vector_text(motion.point)]
        return [name_text(motion.box), str(motion.plane), *turn]
    if isinstance(motion, model.BoxMotion):
        by = motion.vector if isinstance(motion, model.Ffd) else (motion.amount,)
        return [name_text(motion.box), *map(str, motion.index), *_numbers(*by)]
    if isinstance(motion, model.SpanMotion):
        return [curve_text(motion), *([] if motion.point is None else [vector_text(motion.point)])]
    if isinstance(motion, model.FromFile):
        path = path_text(motion.path)
        # Commas and spaces separate here, unlike in a value that is a path only.
        path = f'"{path}"' if any(sign in path for sign in " ,") and path[0] != '"' else path
        return [
            path,
            *(_numbers(motion.limit) if isinstance(motion, model.Onto) and motion.limit else []),
        ]
    place = "centroid" if motion.point == "centroid" else vector_text(motion.point)
    if isinstance(motion, model.Scale):
        return [*_numbers(*motion.factors), place]
    axis = [axis_text(motion.axis)]
    if isinstance(motion, model.Radial):
        numbers = _numbers(motion.factor, motion.distance)
        return [*numbers, *(axis if len(motion.point) == 3 else []), place]
    if axis == ["z"] and (motion.point == "centroid" or len(motion.point) == 2):
        axis = []
    return [*_numbers(motion.angle_deg), *axis, place]


def _target_text(target: Target) -> str:
    names = [name_text(name) for name in named(target)]
    if isinstance(target, str):
        return names[0] if names else ALL_MOVING
    if len(names) < 2 or len(set(names)) < len(names):
        raise CaseError(f"{target} are not several markers; give a name, or two different ones")
    return f"({', '.join(names)})"


def _numbers(*values: float) -> list[str]:
    return [repr(float(value)) for value in values]


GRAMMAR = (
    "(BLADE, translate, dx, dy[, dz])",
    "(BLADE, rotate, degrees, centroid)            counter-clockwise; in 3D about z",
    "(BLADE, rotate, degrees, px, py)              about a point, in 2D",
    "(BLADE, rotate, degrees, AXIS, centroid)      AXIS: x, y, z or three numbers",
    "(BLADE, rotate, degrees, AXIS, px, py, pz)",
    "(BLADE, scale, FACTORS, centroid)             FACTORS: one, or one for each axis",
    "(BLADE, scale, FACTORS, (px, py[, pz]))",
    "(HUB, radial, FACTOR, dr, AXIS, (px, py, pz))  radius r becomes FACTOR r + dr; 2D: no AXIS",
    "(WING, hicks-henne, SIDE, peak, h[, x0, x1])  SIDE: upper or lower; peak: part of the chord",
    "(WING, cst, SIDE, k, n, h[, x0, x1])          term k of n; chord from x0 to x1, else 0 to 1",
    "(WING, bump, peak, h, x0, x1)                 both sides, towards +y",
    "(BLADE, ffd, BOX, i, j, k, dx, dy, dz)        control point of a box; -1: all of an index",
    "(BLADE, ffd-camber, BOX, i, j, dz)            a column of control points; 2D: no j",
    "(BLADE, ffd-thickness, BOX, i, j, dz)         its first one by -dz, its last by dz",
    "(BLADE, ffd-twist, BOX, j, degrees, AXIS, (px, py, pz))  a plane of control points",
    "(BLADE, twist, 0:0, 0.5:1.5, 1:4)             span:degrees, about the stacking line; in 3D",
    "(BLADE, stagger, degrees)                     one angle for all spans",
    "(BLADE, lean, 0:0, 1:0.01)                    span:length, along theta; sweep: along m",
    "(BLADE, chord, 0:1, 1:1.1)                    span:factor; camber: span:part of the chord",
    "(BLADE, twist, 0:0, 1:4, (px, py, pz))        with a point of the stacking line",
    "(BLADE, file, path)                           node, dx, dy[, dz] in each line",
    "(BLADE, onto, path[, limit])                  the surface in a file; limit: what may remain",
    "(*, VERB, ...)                                all moving boundaries, as one body",
    "((BLADE, TIP), VERB, ...)                     several, as one body; in a sweep: BLADE+TIP",
    "centroid: mean of the nodes of what is moved, where they are at that moment",
)
MOTIONS = Kind(
    "(MARKER, VERB, ...) ; (MARKER, VERB, ...)", read_motions, write_motions, details=GRAMMAR
)
