"""What is no ordinary file is refused at once, wherever it is named."""

import os
from pathlib import Path

import pytest

from slideviz.case.lines import LARGEST, read_text
from slideviz.errors import CaseError, MeshError
from slideviz.formats.files import read

KINDS = sorted(LARGEST)


@pytest.fixture(params=["pipe", "/dev/zero", "/dev/null"])
def endless(request, tmp_path) -> Path:
    if request.param != "pipe":
        return Path(request.param)
    os.mkfifo(tmp_path / "pipe")
    return tmp_path / "pipe"


@pytest.mark.parametrize("what", KINDS)
@pytest.mark.timeout(20)
def test_text_is_not_read_from_pipes_and_devices(endless, what):
    with pytest.raises(CaseError, match="this is a device or pipe; choose an ordinary file"):
        read_text(endless, what)


@pytest.mark.timeout(20)
def test_meshes_are_not_read_from_pipes_and_devices(endless, tmp_path):
    named = tmp_path / "mesh.su2"
    named.symlink_to(endless)
    for path in (endless, named):
        with pytest.raises(MeshError, match="this is a device or pipe; choose an ordinary file"):
            read(path)


@pytest.mark.parametrize("what", KINDS)
def test_text_has_a_largest_size(tmp_path, monkeypatch, what):
    monkeypatch.setitem(LARGEST, what, 10)
    (tmp_path / "a").write_text("0123456789")
    assert read_text(tmp_path / "a", what)[0] == "0123456789"
    (tmp_path / "a").write_text("0123456789\n")
    with pytest.raises(CaseError, match=f"a: has 0 MB, and no {what} has more than 0 MB"):
        read_text(tmp_path / "a", what)


@pytest.mark.parametrize("what", KINDS)
def test_a_file_larger_than_memory_is_not_read(tmp_path, what):
    with (tmp_path / "a").open("wb") as file:
        file.truncate(1 << 42)  # a hole
    with pytest.raises(CaseError, match="has 4,398,047 MB, and no"):
        read_text(tmp_path / "a", what)
