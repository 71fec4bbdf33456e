"""What the packages say of slideviz agrees with the program."""

import re
import runpy
import shutil
import subprocess
import tomllib
from configparser import ConfigParser
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml

import slideviz
from slideviz.case.cfg import case_text
from slideviz.case.model import Case
from slideviz.cli.commands import COMMANDS
from slideviz.cli.completion_command import options
from slideviz.session.session_file import ENDING
from tools.smoke import CONFIG

ROOT = Path(__file__).parents[1]
PACKAGING = ROOT / "packaging"
SHARED = PACKAGING / "shared"
MIME = "{http://www.freedesktop.org/standards/shared-mime-info}"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_desktop_opens_every_type_of_file_that_is_declared():
    declared = ET.parse(SHARED / "slideviz.xml").findall(f"{MIME}mime-type")
    types = [one.attrib["type"] for one in declared]
    entry = ConfigParser(interpolation=None)
    entry.read(ROOT / "slideviz" / "gui" / "desktop" / "slideviz.desktop", encoding="utf-8")
    assert entry["Desktop Entry"]["MimeType"].strip(";").split(";") == types
    component = ET.parse(SHARED / "slideviz.metainfo.xml")
    assert [one.text for one in component.findall("provides/mediatype")] == types
    globs = {glob.attrib["pattern"] for one in declared for glob in one.findall(f"{MIME}glob")}
    assert globs == {"*.su2", "*.su2b", f"*{ENDING}"}


def test_a_case_is_known_by_its_content():
    """Other programs use the ending .cfg, too, SU2 among them."""
    tree = ET.parse(SHARED / "slideviz.xml")
    values = [match.attrib["value"] for match in tree.iter(f"{MIME}match")]
    text = case_text(Path("case.cfg"), Case(roles={"BLADE": "moving"}))
    assert text.startswith(values[0])
    assert all(value in text for value in values[1:])
    assert "MESH_FILENAME" in CONFIG
    assert not any(value in CONFIG for value in values)


def test_the_manual_page_has_every_command_and_option(tmp_path):
    page = runpy.run_path(str(PACKAGING / "man.py"))["page"]()
    assert re.findall(r"^\.SS (.*)$", page, re.MULTILINE) == list(COMMANDS)
    for some in options().values():
        for option in some:
            for flag in set(option.flags) - {"-h", "--help"}:
                assert flag.replace("-", r"\-") in page
    if shutil.which("mandoc"):
        file = tmp_path / "slideviz.1"
        file.write_text(page, encoding="utf-8")
        subprocess.run(["mandoc", "-T", "lint", "-W", "warning", file], check=True)


CONDA = {"matplotlib": "matplotlib-base", "pyside6-essentials": "pyside6"}
"""Packages that conda-forge calls otherwise."""


def test_the_recipe_for_conda_needs_what_the_wheel_needs():
    text = (PACKAGING / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    recipe = yaml.safe_load(text)
    assert recipe["context"]["version"] == slideviz.__version__
    names = (re.split(r"[^\w.-]", one)[0] for one in PROJECT["dependencies"])
    needed = {name.lower().replace("_", "-") for name in names}
    run = {one.split()[0] for one in recipe["requirements"]["run"]} - {"python"}
    assert run == {CONDA.get(name, name) for name in needed}


def test_programs_of_the_recipe_are_those_of_the_wheel():
    recipe = yaml.safe_load((PACKAGING / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    wheel = PROJECT["scripts"] | PROJECT["gui-scripts"]
    points = dict(one.split(" = ") for one in recipe["build"]["python"]["entry_points"])
    assert points == wheel


@pytest.mark.parametrize("script", sorted(PACKAGING.glob("*.sh")), ids=lambda path: path.name)
def test_a_script_is_bash(script):
    subprocess.run(["bash", "-n", script], check=True)
