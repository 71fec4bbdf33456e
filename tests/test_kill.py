"""``make kill`` notices files that are neither old nor new, and what a command should not leave."""

import pytest

from slideviz.system.cleanup import PREFIX
from tools.kill.__main__ import SCENARIOS, drafts, is_whole, main, wrong

RUN, SWEEP, PICTURE = SCENARIOS["run"], SCENARIOS["sweep"], SCENARIOS["picture"]
NEW = {"out.su2": b"NDIME= 2\n", "out.json": b"{}" * 100}


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"old", []), (b"NDIME= 2\n", []), (b"NDIM", ["out.su2 is neither old nor new"])],
)
def test_a_mesh_is_old_or_new(tmp_path, content, told):
    (tmp_path / "out.su2").write_bytes(content)
    assert list(wrong(RUN, tmp_path, {"out.su2": b"old"}, NEW)) == told


def test_an_old_file_stays(tmp_path):
    assert list(wrong(RUN, tmp_path, {"out.su2": b"old"}, NEW)) == ["out.su2 is gone"]
    assert list(wrong(RUN, tmp_path, {}, NEW)) == []
    (tmp_path / "out.json").write_bytes(b"{}")
    assert list(wrong(RUN, tmp_path, {}, NEW)) == ["out.json has 2 bytes, not 200"]


def test_a_table_has_whole_lines(tmp_path):
    (tmp_path / "swept").mkdir()
    for text, count in (("a,b\n1,2\n", 0), ("a,b\n1,2", 1), ("a,b\n1\n", 1)):
        (tmp_path / "swept" / "results.csv").write_text(text)
        assert len(list(wrong(SWEEP, tmp_path, {}, {}))) == count


def test_half_a_picture_and_drafts_are_noticed(tmp_path):
    (tmp_path / "out.png").write_bytes(b"\x89PNG")
    assert not is_whole(tmp_path / "out.png")
    assert list(wrong(PICTURE, tmp_path, {}, {"out.png": b"x"})) == [
        "out.png is neither old nor new"
    ]
    (tmp_path / f"{PREFIX}a.tmp").touch()
    assert drafts(tmp_path) == [f"{PREFIX}a.tmp"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run", "sweep"])
def test_commands_that_are_ended_leave_no_half_file(name, capsys):
    assert main(["--minutes", "0.2", "--seed", "3", "--only", name]) == 0
    assert "0 faults" in capsys.readouterr().out
