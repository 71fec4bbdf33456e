"""What the project says of itself agrees with the program."""

import ast
import re
import tomllib
from configparser import ConfigParser
from importlib import import_module
from itertools import chain
from pathlib import Path

import yaml

import slideviz
from slideviz.cli import PACKAGES
from slideviz.system import missing_libraries
from tools import smoke

ROOT = Path(__file__).parents[1]
PACKAGE = Path(slideviz.__file__).parent
MADE = {
    "x.py",
    "index.md",
    "demo/",
    "study/",
    "tests/golden/new/",
    "build/docs/html",
    "x_streamed.py",
    "plot_N_name.py",
}
"""What CONTRIBUTING.md cites and a clean copy lacks: results, and names of no file."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_citation_names_this_version_and_the_thesis():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == slideviz.__version__
    (thesis,) = citation["references"]
    assert "Radial Basis Function Interpolation" in thesis["title"]


def test_no_address_is_invented():
    assert "urls" not in PROJECT["project"]  # CONTRIBUTING.md says where the first address goes
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("slideviz/**/*.py")]
    texts += [ROOT / "docs" / "conf.py", ROOT / "CITATION.cff"]
    assert [path for path in texts if "github.com/slideviz" in path.read_text("utf-8")] == []


def test_all_dependencies_are_known_by_what_needs_them():
    needed = {re.split(r"[^\w.-]", one)[0] for one in PROJECT["project"]["dependencies"]}
    assert {*f"{smoke.COMPUTING} {smoke.PLOTS} {smoke.PICTURES} {smoke.WINDOW}".split()} == needed
    page = (ROOT / "docs" / "tutorials" / "cluster.md").read_text(encoding="utf-8")
    assert f"pip install {smoke.COMPUTING} {smoke.PLOTS}\n" in page
    assert f"`pip install {smoke.PICTURES}`" in page
    assert smoke.PICTURES in PACKAGES.values()


def test_the_desktop_file_starts_what_is_installed():
    entry = ConfigParser(interpolation=None)
    shared = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
    (desktop,) = [path for path in shared if path.endswith(".desktop")]
    entry.read(ROOT / desktop, encoding="utf-8")
    command = entry["Desktop Entry"]["Exec"].split()[0]
    module, _, name = PROJECT["project"]["gui-scripts"][command].partition(":")
    assert callable(getattr(import_module(module), name))
    icons = [path for path in shared if path.endswith(f"{entry['Desktop Entry']['Icon']}.svg")]
    assert len(icons) == 1
    assert (ROOT / icons[0]).is_file()


def test_every_dependency_has_a_tested_version():
    pinned = {
        _name(line)
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        if not line.startswith("#")
    }
    extras = PROJECT["project"]["optional-dependencies"].values()
    wanted = [*PROJECT["project"]["dependencies"], *chain.from_iterable(extras)]
    wanted = [line for line in wanted if not line.startswith("slideviz[")]  # its own extras
    assert {_name(line) for line in wanted} <= pinned


def test_setup_installs_the_libraries_that_the_window_needs():
    text = (ROOT / "tools" / "setup.sh").read_text(encoding="utf-8")
    (listed,) = re.findall(r"^PACKAGES=\((.*?)\)$", text, re.MULTILINE | re.DOTALL)
    # These come with one of the others.
    assert {*missing_libraries.WINDOW.values(), *missing_libraries.OPENGL} - {*listed.split()} <= {
        "libx11-xcb1", "libxcb-xkb1", "libgl1-mesa-dri",
    }  # fmt: skip


def _name(requirement: str) -> str:
    """Return the name of a requirement as package indexes compare it."""
    kept = requirement.replace("_", "-").lower()
    return kept[: next((i for i, c in enumerate(kept) if c in "=<>~; "), len(kept))]


def test_a_name_of_a_class_means_one_thing_in_its_package():
    places = {}
    for path in sorted(Path(slideviz.__file__).parent.rglob("*.py")):
        for part in ast.parse(path.read_text()).body:
            if isinstance(part, ast.ClassDef) and not part.name.startswith("_"):
                package = str(path.parent.relative_to(ROOT))
                places.setdefault((package, part.name), []).append(path.name)
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


EVERYDAY = (
    "anew came doubt found given goes going kept looked own rated rest room said stands tell told "
    "whole"
)
"""Words that name nothing, as a name or with one underscore before it."""
STRUCK = (
    "ALONE Alone Answer Around Beside Course Doing FrozenSpread Given Kept Lag Looked Make Memento "
    "Paper Plan Rated Reel Rest Shot Spread Take Tally Tallying Watch Whole actions_ arranging "
    "as_drawn barred both_ways crowded differing docks_ dress exposing favour given_for "
    "given_input given_mesh in_order keep_view kept_view moved_by picturing posing "
    "require_ordinary require_right row_names seen_beside settled tell_all tell_lost twofold "
    "unmoved usable ways_of"
)
"""Names that had one reader, who wrote them; each has a better one in a textbook's index."""


def test_names_are_those_of_textbooks():
    struck = {*STRUCK.split(), *EVERYDAY.split(), *(f"_{word}" for word in EVERYDAY.split())}
    found = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        place = str(path.relative_to(PACKAGE))
        names = {path.stem}
        for part in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names |= _defined(part)
            assert not (isinstance(part, ast.Name) and "colour" in part.id.lower()), place
        found |= {f"{place}: {name}" for name in names if name in struck or "colour" in name}
    assert found == set()


def _defined(part: ast.AST) -> set[str]:
    """Return the names of functions and classes, and those in the body of a module or class."""
    if isinstance(part, ast.FunctionDef):
        return {part.name}
    if not isinstance(part, ast.ClassDef | ast.Module):
        return set()
    names = {part.name} if isinstance(part, ast.ClassDef) else set()
    for line in part.body:
        targets = line.targets if isinstance(line, ast.Assign) else []
        targets = [line.target] if isinstance(line, ast.AnnAssign) else targets
        names |= {name.id for target in targets for name in ast.walk(target) if _is_stored(name)}
    return names


def _is_stored(part: ast.AST) -> bool:
    return isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)


CITED = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
IN_FILE = re.compile(r"((?:`\w+`(?:, | and |, and )?)+) in `([\w/.]+\.(?:py|toml))`")


def test_contributing_cites_files_that_exist():
    cited = {
        name
        for name in re.findall(r"`([\w./-]+(?:\.(?:py|csv|md|toml|cff|txt)|/))`", CITED)
        if name not in MADE
    }
    assert len(cited) > 60
    lacking = {name for name in cited if not (ROOT / name).exists()}
    assert {name for name in lacking if not (PACKAGE / name).exists()} == set()


def test_contributing_cites_names_that_are_in_their_files():
    rows = IN_FILE.findall(CITED)
    assert len(rows) > 40
    for names, file in rows:
        path = ROOT / file if (ROOT / file).exists() else PACKAGE / file
        words = set(re.findall(r"\w+", path.read_text(encoding="utf-8")))
        assert set(re.findall(r"\w+", names.replace(" and ", " "))) <= words, file


BEHAVIOURS = {
    "gui": {
        "cgns", "elided", "end_to_end", "export", "inputs", "invalid", "key_form", "keyboard",
        "large_mesh", "leaks", "names", "open_su2b", "piece_runner", "quick", "radial", "refit",
        "responsive", "room", "steps_in_one_file", "tips", "warm_up",
    },
    "golden": {"alike", "golden"},
    "plots": {"by_hand"},
    "scene": {"kept_shapes"},
    "session": {"seen_values"},
}  # fmt: skip
"""Tests of what several modules of a room do together; all others are named by their module."""


def test_tests_are_named_by_the_modules_that_they_test():
    """Either test_<module>.py, or test_<module>_<more>.py; the room's word may stand before it."""
    lost = []
    for path in sorted((ROOT / "tests").rglob("*/test_*.py")):
        room, subject = path.parent.name, path.stem.removeprefix("test_")
        folder = ROOT / "slideviz" / room
        names = {part.stem for part in folder.rglob("*") if part.is_dir() or part.suffix == ".py"}
        words = subject.split("_")
        starts = [words, words[1:]] if words[0] in room else [words]
        named = any("_".join(s[:k]) in names for s in starts for k in range(1, len(s) + 1))
        if named == (subject in BEHAVIOURS.get(room, set())):
            lost.append(str(path))
    assert not lost


def test_no_two_files_of_tests_have_one_name():
    """pytest would take the second for the first."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
