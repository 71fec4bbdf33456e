"""Plotters, scenes and small meshes that the tests of several packages draw."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample, write_sample
from slideviz.scene.scene import Scene
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame


def square_mesh(n=4):
    """n x n unit quadrilaterals, with a boundary on each side."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    ids = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], -1).reshape(-1, 4)

    def line(name, nodes):
        return Marker(name, Cells.from_blocks([(3, np.stack([nodes[:-1], nodes[1:]], 1))]))

    markers = (
        line("bottom", ids[0]),
        line("right", ids[:, -1]),
        line("top", ids[-1][::-1]),
        line("left", ids[::-1, 0]),
    )
    points = np.stack([x.ravel(), y.ravel()], 1)
    return Mesh(points, Cells.from_blocks([(9, quads)]), markers, name="square")


@pytest.fixture
def window_size():
    """Width and height of the plotter in pixels; modules have their own."""
    return [420, 300]


@pytest.fixture
def plotter(window_size):
    made = pv.Plotter(off_screen=True, window_size=window_size)
    yield made
    made.close()


@pytest.fixture
def scene(plotter):
    return Scene(plotter)


@pytest.fixture(scope="session")
def square():
    return square_mesh()


@pytest.fixture(scope="session")
def session(square):
    return open_mesh(StepFrame(square, quality(square)), None)


@pytest.fixture(scope="session")
def cube():
    return sample("hexahedron", size=8).mesh


@pytest.fixture(scope="session")
def passage():
    return sample("passage", size=12)


@pytest.fixture(scope="session")
def kept_passage(tmp_path_factory):
    """The folder of that passage; nobody writes to it."""
    folder = tmp_path_factory.mktemp("kept") / "passage"
    write_sample("passage", folder, 12)
    return folder
