"""A mesh file does not make the program read other files of the disk."""

import h5py
import meshio
import numpy as np
import pytest

from slideviz.errors import MeshError
from slideviz.formats.files import read
from slideviz.formats.meshio.bridge import read_with_meshio

POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
TRIANGLE = [("triangle", np.array([[0, 1, 2]]))]


@pytest.fixture
def folder(tmp_path):
    """A folder with a mesh as XDMF and HDF5, beside one with secrets."""
    (tmp_path / "here").mkdir()
    (tmp_path / "secret").mkdir()
    with h5py.File(tmp_path / "secret" / "a.h5", "w") as file:
        file["points"] = POINTS
    meshio.Mesh(POINTS, TRIANGLE).write(tmp_path / "here" / "m.xdmf")
    return tmp_path / "here"


def here(path):
    """Return the mesh as the reader's own process does it."""
    return read_with_meshio(path)


def test_numbers_beside_an_xdmf_file_are_read(folder):
    assert (folder / "m.h5").exists()
    assert len(here(folder / "m.xdmf").points) == 3
    assert len(read(folder / "m.xdmf").points) == 3


@pytest.mark.parametrize("name", ["../secret/a.h5:/points", "{secret}/a.h5:/points"])
def test_xdmf_does_not_name_another_folder(folder, name):
    text = (folder / "m.xdmf").read_text()
    assert text.count("m.h5:/data0") == 1
    name = name.format(secret=folder.parent / "secret")
    (folder / "m.xdmf").write_text(text.replace("m.h5:/data0", name))
    match = r"m.xdmf: names a file of another folder, '.*secret/a.h5', which is not read; put it"
    with pytest.raises(MeshError, match=match):
        read(folder / "m.xdmf")


def test_xdmf_does_not_name_binary_numbers_elsewhere(folder):
    text = (folder / "m.xdmf").read_text().replace('Format="HDF"', 'Format="Binary"')
    (folder / "m.xdmf").write_text(text.replace("m.h5:/data0", "/etc/passwd"))
    with pytest.raises(MeshError, match="names a file of another folder, '/etc/passwd'"):
        here(folder / "m.xdmf")


@pytest.mark.parametrize("ending", [".h5", ".med", ".cgns", ".hmf", ".xdmf"])
def test_external_links_are_refused(folder, ending):
    with h5py.File(folder / "m.h5", "a") as file:
        del file["data0"]
        file["data0"] = h5py.ExternalLink("../secret/a.h5", "/points")
    path = folder / "m.xdmf"
    if ending not in (".xdmf", ".h5"):
        path = (folder / "m.h5").rename(folder / f"n{ending}")
    elif ending == ".h5":
        path = (folder / "m.h5").rename(folder / "n.h5m")
    match = "/data0' is an external link to '../secret/a.h5', which is not read; export"
    with pytest.raises(MeshError, match=match):
        here(path)


def test_numbers_stored_or_mapped_elsewhere_are_refused(folder):
    with h5py.File(folder / "external.med", "w") as file:
        file.create_dataset("a/b", (3,), "f8", external=[("../secret/a.h5", 0, 24)])
        file["a/again"] = file["/"]  # a circle
    with h5py.File(folder / "mapped.med", "w") as file:
        layout = h5py.VirtualLayout((3, 2), "f8")
        layout[:] = h5py.VirtualSource("../secret/a.h5", "points", (3, 2))
        file.create_virtual_dataset("b", layout)
    for name in ("external.med", "mapped.med"):
        with pytest.raises(MeshError, match=f"{name}: .*b' is an external link to '../secret/a.h5"):
            here(folder / name)


@pytest.mark.parametrize("ending", [".med", ".cgns"])
@pytest.mark.parametrize(
    "shape", [{"shape": (1 << 31,)}, {"shape": (3,), "chunks": (1 << 31,), "compression": "gzip"}]
)
def test_datasets_without_bytes_in_the_file_are_not_read(folder, ending, shape):
    if "chunks" in shape:
        shape = shape | {"maxshape": (None,)}
    with h5py.File(folder / f"a{ending}", "w") as file:
        file.create_dataset("zeros", data=np.zeros(10**6), compression="gzip")
        file.create_dataset("a/b", dtype="i1", **shape)
    said = "'/a/b' is said to have 2,147 MB, and the file has 0 bytes for it; the file is damaged"
    with pytest.raises(MeshError, match=said):
        here(folder / f"a{ending}")


def test_abaqus_includes_only_what_lies_beside_it(folder):
    meshio.Mesh(POINTS, TRIANGLE).write(folder / "part.inp")
    whole = (folder / "part.inp").read_text()
    (folder / "m.inp").write_text("*HEADING\n*INCLUDE, INPUT=part.inp\n")
    assert len(here(folder / "m.inp").points) == 3
    (folder.parent / "secret" / "part.inp").write_text(whole)
    (folder / "m.inp").write_text("*HEADING\n*Include, input=../secret/part.inp\n")
    with pytest.raises(MeshError, match=r"m.inp: names a file of another folder, '../secret/part"):
        here(folder / "m.inp")
    (folder / "part.inp").write_text("*INCLUDE, INPUT=/etc/passwd\n")
    (folder / "m.inp").write_text("*INCLUDE, INPUT=part.inp\n")
    with pytest.raises(MeshError, match=r"part.inp: names a file of another folder, '/etc/passwd'"):
        here(folder / "m.inp")


def test_files_that_name_each_other_come_to_an_end(folder):
    (folder / "m.inp").write_text("*INCLUDE, INPUT=m.inp\n")
    with pytest.raises(MeshError, match=r"m.inp: cannot be read"):
        read(folder / "m.inp")
