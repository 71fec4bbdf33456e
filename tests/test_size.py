"""``tools/size.py`` counts what a reader has to take in, however it is laid out."""

from pathlib import Path

import pytest

from tools import size

MODULE = '''"""A module."""

x = 1  # one


def area(width, height):
    """Return the area."""
    return width * height
'''


def test_names_operators_numbers_and_strings_count():
    assert size.tokens_in("x = f(1, 'a')\n") == 8
    assert size.tokens_in(MODULE) == 3 + 8 + 4


def test_layout_comments_and_docstrings_count_nothing():
    packed = "x = 1; area = lambda width, height: width * height\n"
    assert size.tokens_in("x = 1  # why\n\n\n") == size.tokens_in("x = 1\n")
    assert size.tokens_in('class A:\n    x: int\n    """Its text."""\n') == 7 - 1
    assert size.tokens_in(packed) == size.tokens_in(packed.replace(": ", ": \\\n"))
    assert size.tokens_in('"""Text."""\n') == 0
    assert size.tokens_in('x = """Text."""\n') == 3


@pytest.mark.parametrize("text", ["f'a'", "f'{a} {b!r:>{width}}'", "f'{f(\"x\")}'"])
def test_an_interpolated_string_is_one_token(text):
    assert size.tokens_in(f"x = {text}\n") == 3


def test_each_key_and_value_of_a_table_counts(tmp_path):
    (tmp_path / "terms.toml").write_text('# Words.\n[roles.fixed]\nname = "fixed"\nends = [1, 2]\n')
    (tmp_path / "theme.json").write_text('{"light": {"edge": "#000"}}')
    assert size.by_package(tmp_path) == {"terms.toml": 4 + 3, "theme.json": 2 + 1}


def test_packages_are_counted_and_the_budget_holds(tmp_path, capsys, monkeypatch):
    package = tmp_path / "slideviz" / "mesh"
    package.mkdir(parents=True)
    (package / "a.py").write_text("x = 1\n")
    (package.parent / "errors.py").write_text("y = -1\n")
    assert size.by_package(tmp_path / "slideviz") == {"mesh": 3, "errors.py": 4}
    monkeypatch.setattr(size, "ROOT", tmp_path)
    settings = Path(tmp_path / "pyproject.toml")
    settings.write_text("[tool.slideviz]\ntoken-budget = 7\n")
    assert size.main() == 0
    settings.write_text("[tool.slideviz]\ntoken-budget = 6\n")
    assert size.main() == 1
    assert "above the budget" in capsys.readouterr().out
