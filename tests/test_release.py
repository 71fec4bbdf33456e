"""What publishes a version: the check of its tag, and the workflows."""

import re
from pathlib import Path

import pytest
import yaml

import slideviz
from tools.release import faults

ROOT = Path(__file__).parents[1]
WORKFLOWS = {
    path.stem: yaml.safe_load(path.read_text(encoding="utf-8"))
    for path in (ROOT / ".github" / "workflows").glob("*.yml")
}
TRIGGERS = True  # YAML 1.1 reads the key `on` as true


@pytest.fixture
def released(tmp_path):
    """A copy of the files that have the version, with the date of a release."""
    (tmp_path / "slideviz").mkdir()
    for name in ("slideviz/__init__.py", "CITATION.cff"):
        (tmp_path / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    heading = (
        f"# Changelog\n\n## [{slideviz.__version__}] - 2026-12-01\n\n## [0.0.1] - 2026-01-01\n"
    )
    (tmp_path / "CHANGELOG.md").write_text(heading, encoding="utf-8")
    return tmp_path


def test_a_tag_of_the_version_passes(released):
    assert faults(f"v{slideviz.__version__}", released) == []


@pytest.mark.parametrize(
    ("name", "before", "after", "said"),
    [
        (None, "", "", "the tag is v9.9.9, and __version__ is"),
        ("CITATION.cff", "version: 0", "version: 9", "CITATION.cff has another version; write"),
        ("CHANGELOG.md", "- 2026-12-01", "- unreleased", "the newest heading of CHANGELOG.md is"),
        ("CHANGELOG.md", "## [0.1.0]", "## [Unreleased]", "write e.g. ## [0.1.0] - 2026-12-01"),
        ("CHANGELOG.md", "## ", "", "is 'no heading'; write"),
    ],
)
def test_what_does_not_fit_the_tag_is_told(name, before, after, said, released):
    tag = f"v{slideviz.__version__}" if name else "v9.9.9"
    if name:
        path = released / name
        path.write_text(path.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    (fault,) = faults(tag, released)
    assert said in fault


def test_the_newest_heading_of_the_changelog_is_this_version():
    only, *_ = re.findall(r"^## \[(.*?)\]", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert only in (slideviz.__version__, "Unreleased")


def test_only_a_tag_publishes_and_no_secret_is_used():
    publish = WORKFLOWS["publish"]
    assert publish[TRIGGERS] == {"push": {"tags": ["v*"]}}
    trusted = publish["jobs"]["pypi"]
    assert trusted["permissions"] == {"id-token": "write"}
    assert trusted["environment"] == "pypi"
    for path in (ROOT / ".github").rglob("*.yml"):
        assert "secrets." not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", WORKFLOWS)
def test_workflows_may_only_read_and_call_targets_that_exist(name):
    workflow = WORKFLOWS[name]
    assert workflow["permissions"] == {"contents": "read"}
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for job in workflow["jobs"].values():
        assert job["steps"]
        for step in job["steps"]:
            assert set(re.findall(r"\bmake ([a-z-]+)", step.get("run", ""))) <= targets


def test_the_tests_run_on_three_systems_and_every_night():
    systems = WORKFLOWS["ci"]["jobs"]["systems"]["strategy"]["matrix"]["system"]
    assert {one.partition("-")[0] for one in systems} == {"windows", "macos"}
    assert WORKFLOWS["ci"]["jobs"]["check"]["runs-on"] == "ubuntu-latest"
    assert {"slow", "coverage", "newest"} <= set(WORKFLOWS["nightly"]["jobs"])
    assert "schedule" in WORKFLOWS["nightly"][TRIGGERS]
