"""The command line, and the program in Python, that make again what a session shows.

Both name the file of the case, and set the keys in which the case differs from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import floor, log10
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple

from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.zone_cases import with_marker_names
from slideviz.color_scheme import COLOR_MAP
from slideviz.errors import CaseError
from slideviz.formats.table import usual_ending
from slideviz.session.motions import shown_case
from slideviz.session.panes import second_session
from slideviz.session.saving import Camera, view_to_case
from slideviz.session.state import UNDEFORMED, Session, result_settings
from slideviz.terms import DIFFERENCES, quantity_of

_DIGITS = 5  # decimals of the camera's numbers, relative to half the height of the view
_VIEW = {"zoom": "view"}
_RUN = "*_, step = sv.deform(case, mesh)"


class Scripts(NamedTuple):
    """What makes a result again: a command line, and a program in Python."""

    command: str
    python: str


class _Recipe:
    """What the scripts of a session have in common: its case, and what differs in its file.

    ``camera``: that of the view, where this is drawn. Raises CaseError if the case has no file, or
    no option can say how it differs.
    """

    def __init__(self, session: Session, camera: Camera | None = None) -> None:
        source = session.case_file
        mesh = session.mesh
        if source is None or mesh is None:
            raise CaseError("a command names the file of the case, which has none yet; save it")
        self.source = source.absolute()
        file = with_marker_names(Case.read(self.source), mesh).with_paths(Path.absolute)
        seen = file.view.get("VIEW_CAMERA")
        place = camera and _rounded(camera)
        place = seen if seen and _rounded(seen) == place else place
        view = file.view if camera is None else view_to_case(session, place).view
        self.case = shown_case(session).with_paths(Path.absolute).change(view=view)
        self.keys = changed_keys(file, self.case)
        self.frame = min(session.view.frame, len(session.frames) - 1)
        self.deformed = f"{self.source.stem}_deformed{usual_ending(mesh)}"

    def scripts(self, command: str, path: str, flags: Mapping[str, Any], *lines: str) -> Scripts:
        """Return a command with its options, and lines that follow those that read the mesh."""
        words = [f"slideviz {command} {quote(str(self.source))} -o {quote(path)}", *_flags(flags)]
        read = {"zone": self.case.zone, "file_format": self.case.mesh_format}
        begin = (
            "import slideviz as sv\n",
            f"case = sv.Case.read({str(self.source)!r}){_set(self.keys)}",
            f"mesh = sv.read(case.mesh_file{_arguments(read)})",
        )
        words += _flags({"set": {} if command.startswith("section") else self.keys})
        return Scripts(" \\\n  ".join(words) + "\n", "\n".join((*begin, *lines)) + "\n")


def run_scripts(session: Session, *_: object) -> Scripts:
    """Return what makes the run of a session again."""
    recipe = _Recipe(session)
    path = recipe.deformed
    return recipe.scripts("run", path, {}, _RUN, f"sv.write({path!r}, step.mesh)")


def film_scripts(session: Session, camera: Camera, *_: object) -> Scripts:
    """Return what makes the film of the view of a session again.

    Errors of these functions: CaseError if the case has no file, or no option can say how it
    differs.
    """
    recipe = _Recipe(session, camera)
    path = f"{recipe.source.stem}_steps.mp4"
    film = f"sv.film({path!r}, mesh, sv.deform(case, mesh), case=case, zoom='view')"
    return recipe.scripts("film", path, _VIEW, film)


def picture_scripts(session: Session, camera: Camera, size: tuple[int, int]) -> Scripts:
    """Return what makes a picture of the view of a session again, as `film_scripts`.

    ``size``: its width and height in pixels.
    """
    recipe = _Recipe(session, camera)
    path = f"{recipe.source.stem}.png"
    frame = recipe.frame
    flags: dict[str, Any] = {**_VIEW, "size": size}
    said = _arguments(flags)
    if not frame:
        call = f"sv.picture({path!r}, mesh, case=case{said})"
        return recipe.scripts("picture", path, {**flags, "step": 0}, call)
    lines = [f"step = list(sv.deform(case, mesh))[{frame - 1}]"]
    if frame < session.planned:
        flags["step"] = frame
    second = second_session(session)
    if session.view.beside == UNDEFORMED:
        flags["beside"] = "undeformed"
        said += ", beside='undeformed'"
    elif second is not None:
        other = shown_case(second).with_paths(Path.absolute).change(view=recipe.case.view)
        flags["beside"] = changed_keys(recipe.case, other)
        lines.append(f"other = case{_set(flags['beside'])}")
        lines.append(f"beside = other, list(sv.deform(other, mesh))[{second.view.frame - 1}]")
        said += ", beside=beside"
    lines.append(f"sv.picture({path!r}, step.mesh, mesh, case=case, step=step{said})")
    return recipe.scripts("picture", path, flags, *lines)


def section_scripts(session: Session, *_: object) -> Scripts:
    """Return what makes the picture of the selected section again, as `film_scripts`.

    Raises CaseError, too, if none is selected, or a step before the last is shown.
    """
    recipe = _Recipe(session)
    section = session.view.section
    if section is None or recipe.frame not in (0, session.planned):
        raise CaseError("select a section (panel Sections), and show the last step or the first")
    if session.view.color_by in DIFFERENCES:
        raise CaseError("a section of one run shows no difference; copy the view, or other colors")
    path = f"{recipe.source.stem}_section.png"
    mesh = recipe.deformed if recipe.frame else str(recipe.case.mesh_file)
    shown = "step.mesh" if recipe.frame else "mesh"
    view = session.view
    usual = {"color": "size-skew", "color_range": None, "color_map": COLOR_MAP}
    colors = (quantity_of(view.color_by), view.color_range, view.color_map)
    options = {
        name: value
        for (name, default), value in zip(usual.items(), colors, strict=True)
        if value != default
    }
    sizes = {} if section.terms.size is None else {section.terms.size.field: section.size}
    flags: dict[str, Any] = {
        section.kind: (*sizes.values(), *section.direction, *section.origin),
        "whole" if section.whole_cells else "cut": True,
    }
    numbers = _arguments({**sizes, "whole_cells": section.whole_cells or None})
    place = f"sv.Section({section.kind!r}, {section.origin}, {section.direction}{numbers})"
    place = f"span={section.size}" if section.kind == "span" else place
    style = f"sv.SectionStyle(trimmed=True, name={Path(mesh).name!r})"
    said = f"case=case, style={style}{_arguments(options)}"
    call = f"sv.section({path!r}, {shown}, {place}, reference=mesh, {said})"
    cut = f"section {quote(mesh)} --case"
    if not recipe.frame:
        return recipe.scripts(cut, path, flags | options, call)
    made = recipe.scripts(cut, path, flags | options, _RUN, call)
    return made._replace(command=f"{run_scripts(session).command.rstrip()} &&\n{made.command}")


SCRIPTS: dict[str, Callable[..., Scripts]] = {
    "picture": picture_scripts,
    "section": section_scripts,
    "film": film_scripts,
    "run": run_scripts,
}
"""What can be made again, with the function of its scripts: of session, camera and size."""


def changed_keys(file: Case, case: Case) -> dict[str, str]:
    """Return the keys, with their texts, in which a case differs from that of a file.

    Raises CaseError if setting them does not give the same case.
    """
    file = file.change(roles={name: file.roles.get(name, "fixed") for name in case.roles})
    texts = {
        key.name: key.kind.write(value)
        for key in KEYS.values()
        if (value := key.get(case)) is not None and value != key.get(file)
    }
    again = file.set(**texts)
    if (result_settings(again), again.view) != (result_settings(case), case.view):
        raise CaseError("the case leaves out a key that its file has; save the case first")
    return texts


def _rounded(camera: Camera) -> Camera:
    digits = max(_DIGITS - floor(log10(camera[9])), _DIGITS)
    return tuple(round(number, digits) for number in camera)


def _flags(options: Mapping[str, Any]) -> Iterator[str]:
    """Yield options as they are on a command line."""
    for name, value in options.items():
        flag = f"--{name.removeprefix('color_')}"
        if isinstance(value, Mapping):
            yield from (f"{flag} {quote(f'{key}={text}')}" for key, text in value.items())
        elif isinstance(value, tuple):
            yield f"{flag} {('x' if name == 'size' else ',').join(map(str, value))}"
        else:
            yield flag if value is True else f"{flag} {value}"


def _arguments(options: Mapping[str, Any]) -> str:
    """Return options as arguments that follow others, without those that are None."""
    return "".join(f", {name}={value!r}" for name, value in options.items() if value is not None)


def _set(keys: Mapping[str, str]) -> str:
    return f".set({_arguments(keys)[2:]})" if keys else ""
