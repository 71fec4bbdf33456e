"""What the window copies as a command and as Python runs as pasted, and both draw the same."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError
from slideviz.formats.files import read
from slideviz.samples.table import write_sample
from slideviz.sections.model import Section
from slideviz.session import changes, jobs, scripts
from slideviz.session.saving import view_to_case
from slideviz.session.state import StepFrame
from tests.golden.alike import picture_difference

CAMERA = (3.0, -3.0, 2.4, 0.5, 0.5, 0.5, 0.0, 0.0, 1.0, 0.7123456789, 1.5)
FLAT = (0.5, 0.5, 3.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.7123456789, 1.5)


def opened(path):
    return jobs.open_file(path, None, jobs.Job()).session


def with_run(session, **settings):
    """The session after a run with other settings, shown at its last step."""
    session = changes.start_run(changes.set_case(session, **settings))
    found = []
    jobs.compute(session.case, session.mesh, jobs.Job(found.append))
    frames = [one for one in found if isinstance(one, StepFrame)]
    return changes.end_run(changes.add_frames(session, frames), "done")


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    folder = tmp_path_factory.mktemp("the samples")  # a blank in the path
    write_sample("square", folder / "square", size=8)
    write_sample("hexahedron", folder / "hexahedron", size=5)
    return {
        name: (opened(folder / name / f"{name}.cfg"), camera)
        for name, camera in (("square", FLAT), ("hexahedron", CAMERA))
    }


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(script):
    """Return the files that the command and the program write, by name; both run as pasted."""
    for path in Path().iterdir():
        path.unlink()
    for line in script.command.replace("\\\n", "").split("&&"):
        program, *words = shlex.split(line)
        assert program == "slideviz"
        assert run(words) in (0, 3)
    theirs = {path.name: path for path in Path().iterdir()}
    kept = {name: path.rename(f"command_{name}") for name, path in theirs.items()}
    exec(compile(script.python, "pasted", "exec"), {})
    return {name: (path, Path(name)) for name, path in kept.items() if Path(name).exists()}


def require_alike(script, name):
    files = made(script)
    assert name in files, files
    with Image.open(files[name][0]) as one, Image.open(files[name][1]) as other:
        assert picture_difference(one.convert("RGB"), other.convert("RGB")) == ""
    return files[name][0]


@pytest.mark.parametrize("name", ["square", "hexahedron"])
def test_the_view_of_a_run_with_changed_settings(samples, here, name):
    session, camera = samples[name]
    session = with_run(session, steps=2)
    section = Section("plane", (0.5, 0.5, 0.5), (1.0, 0.2, 0.0), whole_cells=True)
    session = changes.set_view(
        session, color_by="skew", color_map="plasma", sections=(section,), hidden=frozenset()
    )
    script = scripts.picture_scripts(session, camera, (500, 300))
    assert "--set STEPS=2" in script.command
    assert "STEPS='2'" in script.python
    assert "0.712346," in script.command, "few digits"
    assert "--step" not in script.command
    path = require_alike(script, f"{name}.png")
    with Image.open(path) as image:
        assert image.size == (500, 300)
    earlier = scripts.picture_scripts(changes.show_frame(session, 1), camera, (500, 300))
    assert "--step 1" in earlier.command
    require_alike(earlier, f"{name}.png")


def test_the_undeformed_mesh_without_a_run(samples, here):
    session, camera = samples["hexahedron"]
    script = scripts.picture_scripts(session, camera, (300, 200))
    assert "--step 0" in script.command
    assert "deform(" not in script.python
    require_alike(script, "hexahedron.png")


def test_a_comparison_has_what_differs_in_the_second_run(samples, here):
    session, camera = samples["square"]
    session = with_run(with_run(session, steps=1), kernel="gaussian", steps=1)
    session = changes.set_view(session, color_by="size-skew")
    both = changes.show_beside(session, 1)
    script = scripts.picture_scripts(both, camera, (600, 300))
    assert script.command.count("--beside") == 1
    assert "--beside RBF_KERNEL=wendland-c2" in script.command
    assert "--set RBF_KERNEL=gaussian" in script.command
    require_alike(script, "square.png")
    undeformed = changes.show_beside(session, changes.UNDEFORMED)
    script = scripts.picture_scripts(undeformed, camera, (600, 300))
    assert "--beside undeformed" in script.command
    require_alike(script, "square.png")


def test_a_film(samples, here):
    session, camera = samples["square"]
    session = with_run(session, steps=2)
    script = scripts.film_scripts(session, camera)
    files = made(script)
    (one, other) = files["square_steps.mp4"]
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    "section",
    [
        Section("plane", (0.5, 0.5, 0.5), (1.0, 0.2, 0.1)),
        Section("plane", (0.5, 0.5, 0.5), (0.0, 0.0, 1.0), whole_cells=True),
        Section("cylinder", (0.5, 0.5, 0.0), (0.0, 0.0, 1.0), radius=0.35),
    ],
)
@pytest.mark.parametrize("name", ["square", "hexahedron"])
def test_a_section(samples, here, name, section):
    session, _ = samples[name]
    if name == "square" and section.direction[2] and section.kind == "plane":
        section = replace(section, direction=(-1.0, 0.3, 0.0))
    session = with_run(session, steps=1)
    session = changes.set_view(
        session, sections=(section,), section_index=0, color_by="skew", color_range=(0.1, 0.9)
    )
    require_alike(scripts.section_scripts(session), f"{name}_section.png")
    script = scripts.section_scripts(changes.show_frame(session, 0))
    assert "slideviz run" not in script.command
    require_alike(script, f"{name}_section.png")


def test_a_run(samples, here):
    session, _ = samples["hexahedron"]
    session = with_run(session, steps=1, kernel="gaussian")
    script = scripts.run_scripts(session)
    (one, other) = made(script)["hexahedron_deformed.su2"]
    assert (read(one).points == read(other).points).all()
    assert (read(one).points == session.deformed.mesh.points).all(), "it is that of the window"


def test_a_camera_as_it_was_saved_is_not_said_again(samples):
    session, camera = samples["hexahedron"]
    exact = tuple(number + 1e-9 for number in camera)
    case = view_to_case(session, exact)
    path = case.source.with_name("viewed.cfg")
    case.write(path)
    saved = replace(session, case=session.case.change(source=path))
    script = scripts.picture_scripts(saved, exact, (300, 200))
    assert "VIEW_CAMERA" not in script.command + script.python
    moved = (exact[0] + 1.0, *exact[1:])
    assert "VIEW_CAMERA" in scripts.picture_scripts(saved, moved, (300, 200)).command


def test_roles_are_changed_too(samples, here):
    session, _ = samples["square"]
    case = session.case
    roles = dict(case.roles) | {case.markers_with("sliding")[0]: "fixed"}
    session = with_run(session, roles=roles, steps=1)
    (one, _) = made(scripts.run_scripts(session))["square_deformed.su2"]
    assert (read(one).points == session.deformed.mesh.points).all()


def test_what_cannot_be_copied_says_why(samples, here):
    session, camera = samples["square"]
    unsaved = replace(session, case=session.case.change(source=None))
    with pytest.raises(CaseError, match="names the file of the case"):
        scripts.run_scripts(unsaved)
    with pytest.raises(CaseError, match="select a section"):
        scripts.section_scripts(session)
    cut = changes.add_section(session, Section("plane", (0.5, 0.0, 0.0), (1.0, 0.0, 0.0)))
    with pytest.raises(CaseError, match="a section of one run shows no difference"):
        scripts.section_scripts(changes.set_view(cut, color_by="quality-gain"))
    file = session.case.change(view={"VIEW_MAP": "plasma"})
    file.write(file.source.with_name("plasma.cfg"))
    viewed = replace(session, case=session.case.change(source=file.source.with_name("plasma.cfg")))
    with pytest.raises(CaseError, match="save the case first"):
        scripts.picture_scripts(viewed, camera, (300, 200))


def test_set_says_which_key_is_wrong():
    with pytest.raises(CaseError, match=r"set STEP=5: unknown key"):
        sv.Case().set(STEP="5")
