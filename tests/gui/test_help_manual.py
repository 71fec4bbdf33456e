"""The pages of the manual, without a window."""

import re
import tomllib
from pathlib import Path

from slideviz.gui.dialogs import help as manual
from slideviz.gui.dialogs.help import manual_folder, manual_pages, page_text, page_title

ROOT = Path(__file__).parents[2]


def test_every_page_is_listed_once_and_has_a_title_and_no_directive():
    folder = manual_folder()
    assert folder == ROOT / "docs"
    pages = list(manual_pages(folder))
    paths = [path for _, path in pages]
    assert len(set(paths)) == len(paths)
    written = {path for path in folder.rglob("*.md") if "gallery" not in path.parts}
    assert written - set(paths) <= {folder / "index.md"}
    assert [page_title(path) for level, path in pages if level == 0][:2] == ["Tutorials", "How to"]
    for path in paths:
        text = page_text(path)
        assert text.startswith("# "), path
        assert "```{" not in text, path
        for picture in re.findall(r"^!\[[^]]*\]\(([^)]+)\)", text, re.MULTILINE):
            assert (path.parent / picture).is_file(), path


def test_pages_made_by_the_site_say_where_their_text_is(tmp_path):
    assert "INFLUENCE_FACTOR= " in page_text(tmp_path / "reference" / "keys.md")
    assert "slideviz --help" in page_text(tmp_path / "reference" / "commands.md")
    assert "help(slideviz)" in page_text(tmp_path / "reference" / "python.rst")
    assert "docs/examples" in page_text(tmp_path / "gallery" / "plot_2_sliding.rst")
    assert "not in the manual" in page_text(tmp_path / "other")


def test_a_wheel_has_the_pages(monkeypatch, tmp_path):
    """Each section of the index is copied to the place where an installed copy looks."""
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    copied = tables["targets"]["wheel"]["force-include"]
    assert "/docs/**/*.md" in tables["targets"]["sdist"]["include"]
    sections = {path.parent.name for level, path in manual_pages(ROOT / "docs") if level == 0}
    assert {f"docs/{name}" for name in sections} | {"docs/index.md"} == set(copied)
    assert all(there == f"slideviz/manual/{here[5:]}" for here, there in copied.items())
    monkeypatch.setattr(manual, "PLACES", (tmp_path / "manual", tmp_path / "docs"))
    assert manual_folder() is None
    (tmp_path / "manual").mkdir()
    (tmp_path / "manual" / "index.md").write_text("# slideviz")
    assert manual_folder() == tmp_path / "manual"
