"""Messages about runs in the window: requirements, ends, warnings, remedies."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.check import check_case
from slideviz.case.keys import KEYS
from slideviz.case.limits import outcome
from slideviz.case.model import Case
from slideviz.case.motions.motion import applies_to
from slideviz.case.words import counted
from slideviz.errors import Level, Message, SlidevizError, messages_of
from slideviz.mesh.margin import reach_words
from slideviz.mesh.model import Mesh
from slideviz.session.reach import moves_nothing
from slideviz.session.state import PanelPlace, Run, Session, StepFrame
from slideviz.session.walls_table import heights_words
from slideviz.solver.layers import height_warnings
from slideviz.solver.remedies import MOST_NAMES, Remedy, beyond_pitch, fixed_beside, remedies
from slideviz.solver.setup import LOOSE
from slideviz.system.platform import free_memory
from slideviz.system.weak_cache import weak_cache
from slideviz.terms import KERNELS, Texts

LARGE = 1e9  # bytes of memory from which on there is a message before a run on what it takes
RATE = 2e10
"""Floating-point operations a second of a machine with few cores in factoring a large matrix."""


def exact_cost(case: Case, mesh: Mesh) -> str:
    """Return a warning of the memory and time of a large run without data reduction, or "".

    All boundary nodes are control nodes: memory grows with the square of their number, and
    time with the cube.
    """
    if case.method != "rbf" or case.reduction is not None:
        return ""
    names = (name for name in mesh.marker_names if case.roles.get(name) != "internal")
    count = len(mesh.nodes_of(names))
    size = 8.0 * 2.6 * count**2
    if size < LARGE:
        return ""
    minutes = max(case.steps, 1) * 2.0 / 3.0 * count**3 / RATE / 60.0
    time = f"{minutes:.0f} minutes" if minutes >= 1.5 else "a minute"
    free = free_memory()
    left = f" ({free / 1e9:.0f} GB are free)" if np.isfinite(free) else ""
    return (
        f"{count:,} control nodes, without data reduction: about {size / 1e9:.0f} GB of "
        f"memory{left} and {time}, more or less."
    )


def end_parts(run: Run) -> tuple[str, str]:
    """Return the end of a run in a few words, and how far its motion may go, perhaps ""."""
    step = run.last_step
    if run.last is None or step is None:
        return "Ready.", ""
    heights = heights_words(run.last, run.case)
    heights = f"first heights {heights}" if heights else ""
    bad = "; ".join(filter(None, (inverted_words(run), limits_words(run), heights)))
    if len(run.frames) < run.planned:
        bad = f": {bad}" if bad else ""
        return f"Stopped after {run.progress_words}{bad}.", ""
    done = "; ".join(filter(None, (bad, repair_words(run))))
    reach = ""
    if run.safe is not None and run.safe.fraction > 0:
        reach = f"the motion {reach_words(run.safe.fraction)}"
        if path_ending(run):
            reach += ", and valid again at its end"
        if run.safe.cell is None:
            reach = run.safe.words
    if done:
        return (f"Done: {done}; ", f"{reach}.") if reach else (f"Done: {done}.", "")
    return ("Done. ", f"{reach[:1].upper()}{reach[1:]}.") if reach else ("Done.", "")


def stopped_words(run: Run | None) -> str:
    """Return a sentence on a run that ended with a part of its motion; "" for others."""
    if run is None or not run.incomplete or run.last_step is None:
        return ""
    name = run.name.capitalize() if run.panels is not None else f"Run {run.number}"
    how = "was cancelled" if run.end == "cancelled" else "ended"
    part = f"{100.0 * run.last_step.part:.3g} % of its motion"
    return f"{name} {how} after {run.progress_words}: the mesh has {part}."


def path_ending(run: Run) -> str:
    """Return what follows the words of how far a run may go, of `SafeFraction.ending`."""
    if run.last is None or run.safe is None:
        return ""
    return run.safe.ending(run.last.quality.inverted, bool(repair_words(run)))


def repair_words(run: Run) -> str:
    """Return what the repair of a run's last step mended in words; "" if no cell needed it."""
    step = run.last.step if run.last is not None else None
    if step is None or step.repaired is None or not len(step.repaired.cells):
        return ""
    return step.repaired.words()


def preview_words(run: Run) -> str:
    """Return how far the preview of a run was off; "" where there was none."""
    if run.preview_off is None:
        return ""
    part, lowest = run.preview_off
    why = "" if run.case.relax == "no" else ", which has no relaxation,"
    return (
        f"the preview{why} was off by {100.0 * part:.3g} % of the motion, its lowest quality by "
        f"{abs(lowest):.1g}"
    )


def to_mend(session: Session) -> StepFrame | None:
    """Return the frame that a repair would mend: the last step of the shown run, or the mesh.

    None where all its cells are proved valid and above the limit of the case.
    """
    frame = session.deformed or session.first
    if frame is None or session.lacks_cells or frame.label:  # that of a design has another case
        return None
    found = frame.quality
    bad = found.inverted + found.unproven or found.min < session.case.repair_below
    return frame if bad else None


def inverted_words(run: Run) -> str:
    """Return the number of inverted cells after the last step in words; "" for none."""
    count = run.last.quality.inverted if run.last is not None else 0
    return counted(count, "inverted cell") if count else ""


def limits_words(run: Run) -> str:
    """Return how many limits a run misses in words; "" where it misses none."""
    count = sum(not one.passed for one in run.last.limits) if run.last is not None else 0
    verb = "is" if count == 1 else "are"
    return f"{counted(count, 'limit')} {verb} not met" if count else ""


def remedy_for(run: Run, mesh: Mesh | None, folding: Message | None = None) -> str:
    """Return sentences on a run's inverted cells: their first step, and remedies.

    ``run``: a run with inverted cells after its last step. ``mesh``: the undeformed mesh.
    ``folding``: ``Session.folding``: only another motion can mend that.
    """
    if folding:
        return with_field_labels(f"{folding}.")
    assert mesh is not None
    pitch, found = _advice(run, mesh)
    helps = "; ".join(remedy.window for remedy in found)
    helps = with_field_labels(f"What may help: {helps}.")
    last = ""
    valid = [frame.step for frame in run.frames if not frame.quality.inverted and frame.step]
    if valid:
        last = f"Step {valid[-1].index} of {valid[-1].total} is the last without any."
    words = (last, f"{pitch}." if pitch else "", helps)
    return " ".join(filter(None, words))


@weak_cache
def _advice(run: Run, mesh: Mesh) -> tuple[str, tuple[Remedy, ...]]:
    """Return a sentence if the motion is beyond the pitch, or "", and the remedies of a run."""
    beside: Texts = ()
    if run.last is not None:
        beside = fixed_beside(run.case, mesh, run.last.quality.inverted_cells())
    pitch = beyond_pitch(run.case, mesh)
    return pitch, remedies(run.case, beside, pitch, run.last_step)


def remarks_of(run: Run, level: Level) -> Texts:
    """Return the warnings of a run, or its notes."""
    return tuple(with_field_labels(str(message)) for message in _messages_of(run, level))


def _messages_of(run: Run, level: Level) -> tuple[Message, ...]:
    if run.last is None or run.last_step is None:
        return ()
    layers = run.last.walls
    remarks = run.last_step.messages
    if layers is not None:
        remarks += tuple(
            height_warnings(run.case, layers, run.last.mesh, run.last_step.kept_layers)
        )
    return tuple(message for message in messages_of(remarks) if message.level == level)


Settings = tuple[tuple[str, str], ...]
"""Keys of a case, and other values of them that a message advises."""


@frozen
class Requirement:
    """A requirement of a run that is not met."""

    text: str  # a sentence for the user
    place: PanelPlace  # the panel in which it can be met
    marker: str = ""  # the boundary that lacks a motion; empty for other requirements
    motion: int = 0  # the place of the motion that the requirement is about, from 0
    settings: Settings = ()  # each of which would meet it


@frozen
class Notice:
    """A message in the strip over the view, with what its buttons do."""

    kind: Literal["error", "task", "warning", "note"]  # a task is to be done before a run
    text: str
    leads: Requirement | None = None  # where a button leads
    settings: Settings = ()  # a button makes each of these
    commands: Texts = ()  # names of commands that help


def notices(session: Session, missing: tuple[Requirement, ...]) -> Iterator[Notice]:
    """Yield the messages of the session, the most urgent first.

    ``missing``: from `run_requirements`.
    """
    for requirement in missing:
        yield Notice("task", requirement.text, requirement, requirement.settings)
    run = session.run_shown
    folding = session.folding
    if folding and not missing and (run is None or session.outdated):
        text = with_field_labels(f"{folding}.")
        yield Notice("warning", text, Requirement("", "motion"))
    if run is not None and run.last is not None and run.end:
        yield from _notices_of_run(run, session)


def _notices_of_run(run: Run, session: Session) -> Iterator[Notice]:
    """Yield the messages of a run that has ended."""
    assert run.last is not None
    told = ""
    if bad := inverted_words(run):
        folding = None if session.outdated else session.folding
        told = f"{bad}. {remedy_for(run, session.mesh, folding)}"
        again = run.last.step is not None and run.last.step.repaired is None
        commands = ("repair",) if again and to_mend(session) else ()
        settings: Settings = ()
        if session.mesh is not None and not folding:
            advice = "; ".join(each.keys for each in _advice(run, session.mesh)[1])
            settings = advised(advice, session.case)
        yield Notice("error", told, Requirement("", "worst"), settings[:MOST_ADVISED], commands)
    if missed := limits_words(run):
        text = f"{missed}: {outcome(run.last.limits)}."
        yield Notice("error", text, Requirement("", "limits"))
    if words := stopped_words(run):
        yield Notice("warning", words)
    if run.last.file is not None:
        yield Notice("note", f"The deformed mesh is in {run.last.file}.")
    for message in (*_messages_of(run, "warning"), *_messages_of(run, "note")):
        text = with_field_labels(str(message))
        if text.rstrip(".") not in told:
            yield Notice(message.level, text, settings=advised(str(message), session.case))


MOST_ADVISED = 1  # most settings that are offered against inverted cells


def advised(message: str, case: Case) -> Settings:
    """Return the settings that a message names, if the case has other values."""
    found = dict[str, str]()
    for key, value, *_ in _KEY.findall(message):
        with suppress(SlidevizError):
            if value and key not in found and case.set(**{key: value}) != case:
                found[key] = value
    return tuple(found.items())


def run_requirements(session: Session) -> tuple[Requirement, ...]:
    """Return the requirements of a run that are not met, most urgent first."""
    if session.mesh is None:
        return (Requirement("Open a mesh first.", "open"),)
    case = session.case
    # Invalid fields come first: the case, which the rest is about, has their last valid values.
    requirements = [Requirement(text, place) for place, text in session.invalid]
    moving = case.markers_with("moving")
    if not moving:
        requirements.append(
            Requirement("No boundary moves: give one the role “moving”.", "boundaries")
        )
    requirements += [
        Requirement(f"“{name}” has no motion: add one.", "motion", name)
        for name in moving
        if not any(applies_to(motion, name) for motion in case.motions)
    ]
    requirements += [
        Requirement(
            "A motion lacks its box: choose one, or make a new one.", "motion", motion=place
        )
        for place, motion in enumerate(case.motions)
        if motion.incomplete()
    ]
    if case.motions and all(moves_nothing(motion) for motion in case.motions):
        requirements.append(
            Requirement("Nothing moves yet: enter the values of the motion.", "motion")
        )
    for place, motion in enumerate(case.motions):
        for path in motion.files:
            if not path.is_file():
                text = _lacks_file(path, motion.file_words)
                requirements.append(Requirement(text, "motion", motion=place))
    if case.periodic == "moving" and case.sliding == "none":
        text = "Moving periodic vertices need sliding: choose pseudo or direct."
        requirements.append(Requirement(text, "method"))
    if session.lacks_cells and case.method == "elastic":
        text = "Linear elasticity needs all of a mesh in memory, and this one stays in its file."
        requirements.append(Requirement(f"{text} Choose another method.", "method"))
    if not requirements:
        for problem in check_case(case, session.mesh):
            text = with_field_labels(str(problem))
            settings = advised(str(problem), case)
            text = text[:1].upper() + text[1:]
            requirements.append(Requirement(text, "boundaries", settings=settings))
    if not requirements and session.intersection:
        requirements = [Requirement(session.intersection, "motion")]
    return tuple(requirements)


def _lacks_file(path: Path, what: str) -> str:
    """Return a sentence on a motion without its file; ``what``: words for the file."""
    if path == Path():
        return f"A motion lacks its {what}: choose it."
    if path.is_dir():
        return f"{path} is a folder: choose the {what} in it."
    return f"The {what} {path} does not exist."


def tolerance_warning(case: Case, extent: float, largest: float) -> str:
    """Return a sentence where the typed tolerance is not far below the largest displacement.

    ``extent``: that of the mesh. ``largest``: the prescribed one; 0 where it is not known.
    """
    reduction = case.reduction
    if reduction is None or reduction.auto or case.method != "rbf" or not largest > 0.0:
        return ""
    tolerance = reduction.relative * extent if reduction.relative else reduction.tolerance
    if tolerance <= LOOSE * largest:
        return ""
    is_ = "not below" if tolerance >= largest else "more than a tenth of"
    return (
        f"This is {is_} the largest displacement, {largest:.3g}: cells near the boundary may be "
        f"inverted. A hundredth of it is {largest / 100:.2g}."
    )


_LABELLED = sorted((name for name, key in KEYS.items() if key.label), key=len, reverse=True)
# A key with a label, and its values where some follow, as in "SLIDING_MODE= ps or ds".
_VALUE = r"\s?([\w.+-]*\w)(?:( \(?or )([\w-]+))?"
_KEY = re.compile(rf"\b({'|'.join(_LABELLED)})\b(?:=(?:{_VALUE})?)?")
# Values of RBF_KERNEL in a sentence; where some are words of their own only before "is too".
_KERNEL = re.compile(rf"\b({'|'.join(KERNELS)})\b(?= is too)|\b\w+-c\d[ab]?\b")


def idle_text(case: Case) -> Texts:
    """Return a sentence for each role without effect in the case's modes, seldom on purpose."""
    sentences: list[str] = []
    for names, mode, title, verb in (
        (case.markers_with("periodic"), case.periodic, "Periodicity", "stay periodic"),
        (case.markers_with("sliding"), case.sliding, "Sliding", "slide"),
    ):
        who = " and ".join(names) if len(names) <= MOST_NAMES else f"{len(names)} boundaries"
        if names and mode == "none":
            sentences.append(f"{title} is “none”: {who} will not {verb}.")
    return tuple(sentences)


def with_field_labels(text: str) -> str:
    """Return a message with keys of the case file replaced by their labels in the window."""
    kernel = KEYS["RBF_KERNEL"].kind
    return _KERNEL.sub(lambda found: kernel.value_label(found[0]), _KEY.sub(_words, text))


def _words(found: re.Match[str]) -> str:
    key, first, link, second = KEYS[found[1]], *found.groups()[1:]
    label = key.label.removesuffix(" ×")  # which a message would have beside the × that closes it
    if first is None:
        return label
    words = f"{label} “{key.kind.value_label(first)}”"
    if second is None:
        return words
    other = key.kind.value_label(second)
    return f"{words}{link}{second if other == second else f'“{other}”'}"
