"""The meridional view: bins of cells by span and m', and what is drawn of them."""

import json

import numpy as np
import pytest
from matplotlib.figure import Figure

import slideviz as sv
from slideviz.cli import run
from slideviz.plots.meridional import draw_meridional, meridional_bins
from slideviz.plots.section_paint import Paint
from slideviz.samples.impeller import impeller_mesh
from slideviz.sections.span import find_walls
from tests.builders import cube, passage


def test_bins_of_an_annulus_are_its_layers():
    mesh = passage((4, 6, 8))
    (bins,) = meridional_bins(mesh, find_walls(mesh))
    assert bins.shape == (4, 8)
    z, r = bins.places[..., 0], bins.places[..., 1]
    assert r == pytest.approx(np.repeat(np.linspace(0.5, 1.0, 5)[:, None], 9, axis=1), abs=1e-4)
    assert z == pytest.approx(np.tile(np.linspace(0.0, 1.0, 9), (5, 1)), abs=1e-3)
    # Each bin has the ring of cells there: six, or four beside the blade.
    counts = np.bincount(bins.bin_of).reshape(bins.shape)
    assert counts.tolist() == [[6, 6, 6, 4, 4, 6, 6, 6]] * 4
    values = np.arange(len(mesh.cells), dtype=float)
    values[bins.bin_of == 0] = np.nan
    values[np.flatnonzero(bins.bin_of == 9)[0]] = np.inf
    means = bins.means(values)
    assert np.isnan(means[0, 0])
    assert means[1, 1] == values[bins.bin_of == 9][1:].mean()
    assert means[3, 7] == values[bins.bin_of == 31].mean()


def test_a_radial_passage_is_drawn_between_its_walls():
    mesh = impeller_mesh(3000)
    walls = find_walls(mesh)
    (bins,) = meridional_bins(mesh, walls)
    field = walls.field
    hub = field.meridional(mesh.points[mesh.marker("HUB").nodes])
    for row, name in ((0, "HUB"), (-1, "SHROUD")):
        wall = field.meridional(mesh.points[mesh.marker(name).nodes])[:, :2]
        off = [np.linalg.norm(wall - place, axis=1).min() for place in bins.places[row]]
        assert max(off) < 0.08
    assert np.ptp(bins.places[0, :, 1]) == pytest.approx(np.ptp(hub[:, 1]), rel=0.02)
    figure = Figure()
    values = sv.quality(mesh).values
    paint = Paint("size-skew", values, np.zeros(len(values), bool), (0.0, 1.0))
    draw_meridional(figure, [bins], paint)
    axes, bar = figure.axes
    assert [text.get_text() for text in axes.texts] == ["HUB", "SHROUD"]
    assert (axes.get_xlabel(), bar.get_ylabel()) == ("z [mesh units]", "mean size-skew [-]")
    assert np.isfinite(bins.means(values)).mean() > 0.9


def test_the_command_draws_it_and_reports_the_means(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", passage((4, 6, 8)))
    words = ["section", "mesh.su2", "--meridional", "-o", "m.png"]
    assert run([*words, "--json", "m.json", "--no-axes", "--range", "0.5,1"]) == 0
    report = json.loads((tmp_path / "m.json").read_text())
    assert (report["between"], report["cells"]) == (["hub", "shroud"], 176)
    assert np.shape(report["means"]) == (4, 8)
    assert "from hub to shroud" in capsys.readouterr().out
    assert run([*words, "--between", "inflow,hub"]) == 1
    assert "do not face each other" in capsys.readouterr().err
    for option in ("--copies=1", "--3d", "--stream", "--unrolled", "--whole"):
        assert run([*words, option]) == 2
        assert "--meridional shows no section, so leave out" in capsys.readouterr().err
    sv.write("cube.su2", cube())
    assert run(["section", "cube.su2", "--meridional", "-o", "m.png"]) == 1
    assert "do not say between which the span goes" in capsys.readouterr().err
    assert run(["section", "cube.su2", "--span", "0.5", "-o", "m.png"]) == 1
    said = capsys.readouterr().err
    assert "name two, e.g. --between HUB,SHROUD, of " in said
    assert said.endswith("; to find those of a wing, give a case in which it moves\n")
    assert "SPAN=" not in said
