"""A file is written whole or not at all."""

import errno
import os
from pathlib import Path

import pytest

from slideviz.errors import CaseError, MeshError
from slideviz.system.atomic import atomic_write, require_writable


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_writes_and_leaves_nothing_else(tmp_path):
    with atomic_write(tmp_path / "a.su2") as file:
        file.write(b"one\n")
        assert not (tmp_path / "a.su2").exists()
    assert (tmp_path / "a.su2").read_bytes() == b"one\n"
    assert names(tmp_path) == ["a.su2"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no/a.su2", "the folder does not exist; create it first"),
        ("f/a.su2", "a part of the path is a file, not a folder"),
        ("folder", "it is a folder; give the name of a file"),
    ],
)
def test_what_cannot_be_written_is_known_before(tmp_path, name, words):
    (tmp_path / "f").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    with pytest.raises(CaseError, match=f"{name}: cannot be written: {words}"):
        require_writable(tmp_path / name, CaseError)
    assert names(tmp_path) == ["f", "folder"]


def test_asking_whether_a_file_can_be_written_leaves_no_trace(tmp_path):
    (tmp_path / "old.su2").write_bytes(b"old")
    for name in ("old.su2", "new.su2"):
        require_writable(tmp_path / name)
    assert names(tmp_path) == ["old.su2"]
    assert (tmp_path / "old.su2").read_bytes() == b"old"


def write_then_fail(path: Path, problem: BaseException) -> None:
    with atomic_write(path) as file:
        file.write(b"new")
        raise problem


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt, GeneratorExit])
def test_old_file_stays_when_the_block_fails(tmp_path, stop):
    path = tmp_path / "a.su2"
    path.write_bytes(b"old")
    with pytest.raises(stop):
        write_then_fail(path, stop())
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.su2"]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOSPC, "the disk is full; free some space"),
        (errno.EDQUOT, "disk quota is used up; free"),
        (errno.EIO, "Input/output error"),
    ],
)
def test_failing_disk_names_reason_and_keeps_the_old_file(tmp_path, number, words):
    path = tmp_path / "a.su2"
    path.write_bytes(b"old")
    match = f"a.su2: cannot be written: .*{words}"
    with pytest.raises(MeshError, match=match):
        write_then_fail(path, OSError(number, os.strerror(number)))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.su2"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_really_full_device_is_reported(tmp_path):
    def write() -> None:
        with atomic_write(tmp_path / "a.su2") as file, Path("/dev/full").open("wb") as full:
            os.dup2(full.fileno(), file.fileno())
            file.write(b"x" * 100_000)

    with pytest.raises(MeshError, match="the disk is full; free some space"):
        write()
    assert names(tmp_path) == []


def test_missing_folder(tmp_path):
    match = r"cannot be written: the folder does not exist; create it first"
    with pytest.raises(MeshError, match=match), atomic_write(tmp_path / "no" / "a.su2"):
        pytest.fail("the block must not start")


def test_file_in_place_of_the_folder(tmp_path):
    (tmp_path / "f").write_bytes(b"")
    match = "a part of the path is a file, not a folder"
    with pytest.raises(MeshError, match=match), atomic_write(tmp_path / "f" / "a.su2"):
        pytest.fail("the block must not start")


def test_folder_in_place_of_the_file(tmp_path):
    match = "it is a folder; give the name of a file"
    with pytest.raises(MeshError, match=match), atomic_write(tmp_path):
        pytest.fail("the block must not start")


def test_pipe_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    match = "it is a device or pipe; give the name of an ordinary file"
    with pytest.raises(MeshError, match=match), atomic_write(tmp_path / "pipe"):
        pytest.fail("the block must not start")
    assert (tmp_path / "pipe").is_fifo()


def test_write_protected_file_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / "a.su2"
    path.write_bytes(b"old")
    # The tests may run as a user who may write everything.
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(MeshError, match="no permission to write there"), atomic_write(path):
        pytest.fail("the block must not start")
    assert path.read_bytes() == b"old"


def test_too_long_name(tmp_path):
    match = "the file name is too long; choose a shorter one"
    with pytest.raises(MeshError, match=match), atomic_write(tmp_path / ("x" * 300)):
        pytest.fail("the block must not start")


def test_another_file_that_is_missing_is_not_blamed_on_the_target(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "a.su2"):
        (tmp_path / "other").read_bytes()
    assert names(tmp_path) == []


def test_link_stays_a_link_and_permissions_stay(tmp_path):
    real, link = tmp_path / "real.su2", tmp_path / "link.su2"
    real.write_bytes(b"old")
    real.chmod(0o640)
    link.symlink_to(real)
    with atomic_write(link) as file:
        file.write(b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
    assert real.stat().st_mode & 0o777 == 0o640


def test_new_file_has_the_usual_permissions(tmp_path):
    (tmp_path / "usual").write_bytes(b"")
    with atomic_write(tmp_path / "a.su2") as file:
        file.write(b"new")
    assert (tmp_path / "a.su2").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_other_error_class(tmp_path):
    match = "the folder does not exist"
    with pytest.raises(CaseError, match=match), atomic_write(tmp_path / "no" / "a", CaseError):
        pytest.fail("the block must not start")
