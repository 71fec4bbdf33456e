"""How Sphinx builds the documentation: `make docs` writes it into build/docs/html."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pyvista

import slideviz

HERE = Path(__file__).parent

project = "slideviz"
author = copyright = "The slideviz authors"  # noqa: A001
version = release = slideviz.__version__

extensions = [
    "sphinx.ext.autodoc",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["examples", "sg_execution_times.rst"]
default_role = "py:obj"
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
# Gallery pages offer their source, of which no second copy is needed.
html_copy_source = html_show_sourcelink = False

autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

pyvista.BUILDING_GALLERY = True
pyvista.OFF_SCREEN = True
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "image_scrapers": ("pyvista", "matplotlib"),
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "abort_on_example_error": True,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_logo = html_favicon = "../slideviz/gui/desktop/slideviz.svg"
html_title = "slideviz"
html_static_path = ["static"]
html_css_files = ["slideviz.css"]
html_theme_options = {
    "logo": {"text": "slideviz"},
    "navigation_with_keys": False,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}

_KEY = re.compile(r"^[+ ] (?P<name>[A-Z_]+)= (?P<values>.*?)(?:   \[(?P<default>.*)\])?$")


def _said_by(*arguments: str) -> str:
    """Return what a command of slideviz prints."""
    call = [sys.executable, "-m", "slideviz", *arguments]
    return subprocess.run(call, capture_output=True, text=True, check=True).stdout


def _keys_page() -> str:
    """Return the page of the keys, made from what ``slideviz keys`` prints."""
    text = _said_by("keys")
    page = ["# Keys of a case file", ""]
    about = text.index("\n\n") + 2
    first = re.search(r"^[A-Z]{2}[A-Z ]*$", text, re.MULTILINE)
    assert first is not None, "`slideviz keys` has no headings"
    # The page says "own" in words where the terminal has a sign.
    rules = re.sub(r"\s+Keys marked \+ .*?too\.", "", text[about : first.start()], flags=re.DOTALL)
    page += [rules.strip(), ""]
    page += ["`slideviz keys` prints this page in the terminal.", ""]
    listed = False
    for line in text[first.start() :].splitlines():
        key = _KEY.match(line)
        if listed and not line.startswith("        "):
            page, listed = [*page, "```", ""], False
        if key is not None:
            own = " Not a key of RBF-SliDe." if line.startswith("+") else ""
            page += ["", f"### {key['name']}", ""]
            values, default = key["values"].strip(), key["default"] or "none"
            page += [f"Values: `{values}`. Default: `{default}`.{own}", ""]
        elif line.startswith("        "):
            if not listed:
                page, listed = [*page, "", "```text"], True
            page.append(line.strip("\n")[8:])
        elif line.startswith("      "):
            page.append(line.strip())
        elif line.strip():
            page += ["", f"## {line.capitalize()}", ""]
    return "\n".join([*page, "```" if listed else "", ""])


def _commands_page() -> str:
    """Return the page of the commands, made from what ``--help`` prints."""
    text = _said_by("--help")
    page = ["# Commands", "", "```text", text.rstrip(), "```", ""]
    for name in re.findall(r"^    ([a-z]+) ", text, re.MULTILINE):
        page += [f"## slideviz {name}", "", "```text", _said_by(name, "--help").rstrip(), "```", ""]
    return "\n".join(page)


def setup(_: object) -> None:
    """Write the pages that the program itself has the words of."""
    for name, text in (("keys", _keys_page()), ("commands", _commands_page())):
        path = HERE / "reference" / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
