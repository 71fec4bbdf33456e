"""Designs optimised on the mesh alone, with its quality as a constraint and exact gradients."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import slideviz as sv
from slideviz.case.model import Case
from slideviz.ffd.box import plane_corners, regular_box
from tests.builders import square

EXAMPLE = Path(__file__).parents[1] / "docs" / "examples" / "plot_8_optimise.py"
LEAST = 0.5


@pytest.fixture(autouse=True)
def quiet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OPENMDAO_REPORTS", "0")
    monkeypatch.setenv("OPENMDAO_USE_MPI", "0")


class Block:
    """A block in a square that is to go right and up, and to grow, by three numbers."""

    def __init__(self):
        self.mesh = square(8)
        roles = dict.fromkeys(self.mesh.marker_names, "sliding") | {"BLOCK": "moving"}
        case = Case(roles=roles, motions=(sv.Translate("BLOCK", (0.1, 0.1)),), sliding="ps")
        self.deformer = sv.Deformer(self.mesh, case)
        start = self.mesh.points[self.deformer.nodes]
        ones, none = np.ones(len(start)), np.zeros(len(start))
        self.modes = np.stack([np.stack([ones, none], 1), np.stack([none, ones], 1), start - 0.5])
        self.designs = set()

    def displacement(self, design):
        return np.tensordot(design, self.modes, axes=1)

    def rated(self, design):
        self.designs.add(tuple(design))
        points = self.deformer.deform(self.displacement(design))
        return sv.quality(self.mesh.with_points(points), self.mesh, derivative=True)

    def slope(self, design):
        by_points = self.rated(design).derivative.of_minimum
        by_block = self.deformer.vjp(self.displacement(design), by_points)
        return np.tensordot(self.modes, by_block, axes=2)


WANTED = np.array([1.0, 0.8, 0.3])


def test_slsqp_stops_where_the_quality_does():
    block = Block()
    counts = {}
    for exact in (True, False):
        block.designs.clear()
        constraint = {"type": "ineq", "fun": lambda x: block.rated(x).derivative.minimum - LEAST}
        found = minimize(
            lambda x: -WANTED @ x,
            np.zeros(3),
            jac=lambda x: -WANTED,
            constraints=constraint | ({"jac": block.slope} if exact else {}),
            bounds=[(-0.4, 0.4)] * 3,
            method="SLSQP",
        )
        assert found.success
        best = block.rated(found.x)
        assert best.derivative.minimum == pytest.approx(LEAST, abs=1e-5)
        assert LEAST <= best.min < 0.56
        assert best.inverted == 0
        counts[exact] = len(block.designs), WANTED @ found.x
    assert counts[True][1] == pytest.approx(counts[False][1], abs=1e-4)
    assert 1.4 * counts[True][0] < counts[False][0]
    # At the best design the gradient of the constraint is parallel to what is wanted.
    assert np.abs(found.x).max() < 0.4
    slope = block.slope(found.x)
    assert slope @ WANTED == pytest.approx(
        -np.linalg.norm(slope) * np.linalg.norm(WANTED), rel=1e-3
    )


def test_openmdao_finds_the_same_design():
    om = pytest.importorskip("openmdao.api")
    pytest.importorskip("mphys")
    from slideviz.openmdao import MeshDeformation

    block = Block()
    start = block.mesh.points[block.deformer.nodes].ravel()
    modes = block.modes.reshape(3, -1)

    class Shape(om.ExplicitComponent):
        def setup(self):
            # Undeformed, all cells are perfect, and the quality has no slope.
            self.add_input("design", np.full(3, 0.01))
            self.add_output("x_aero", start)
            self.add_output("gain")
            self.declare_partials("x_aero", "design", val=modes.T)
            self.declare_partials("gain", "design", val=WANTED)

        def compute(self, inputs, outputs):
            outputs["x_aero"] = start + inputs["design"] @ modes
            outputs["gain"] = WANTED @ inputs["design"]

    problem = om.Problem(reports=False)
    model = problem.model
    model.add_subsystem("shape", Shape(), promotes=["*"])
    mesh = MeshDeformation(deformer=block.deformer, quality=True)
    model.add_subsystem("mesh", mesh, promotes=["*"])
    model.add_design_var("design", lower=-0.4, upper=0.4)
    model.add_constraint("minimum_quality", lower=LEAST)
    model.add_objective("gain", scaler=-1.0)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", disp=False, tol=1e-8)
    problem.setup(mode="rev")
    done = problem.run_driver()
    assert done.success
    assert problem.get_val("minimum_quality")[0] == pytest.approx(LEAST, abs=1e-6)
    slope = block.slope(problem.get_val("design"))
    along = -np.linalg.norm(slope) * np.linalg.norm(WANTED)
    assert slope @ WANTED == pytest.approx(along, rel=1e-4)
    assert done.deriv_evals <= done.iter_count


@pytest.mark.slow
def test_the_example_widens_the_throat_with_a_tenth_of_the_meshes(monkeypatch):
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", plt.close)
    ran = runpy.run_path(str(EXAMPLE))
    start, best = ran["start"], ran["best"]
    assert -ran["narrowness"](best) > 1.3 * -ran["narrowness"](start)
    moved, rated = ran["measured"](tuple(best))
    assert rated.inverted == 0
    assert rated.min >= rated.derivative.minimum == pytest.approx(0.5, abs=1e-4)
    assert moved.points.shape == ran["mesh"].points.shape
    exact, differences = ran["results"]["exact gradients"], ran["results"]["finite differences"]
    assert exact.fun == pytest.approx(differences.fun, abs=1e-4)
    assert exact.nfev * 8 < differences.nfev
    assert ran["width"] == pytest.approx(-exact.fun, abs=1e-4)
    # Its box is that of the package, in both planes alike.
    corners = np.array([ran["low"], ran["high"]])[[[0, 0], [1, 0], [1, 1], [0, 1]], [0, 1]]
    box = regular_box("BLADE", plane_corners(corners), (3, 1, 1), None)
    nodes, blade = ran["deformer"].nodes, ran["blade"]
    uvw = np.column_stack([ran["u"], ran["v"], np.full(len(nodes), 0.5)])
    np.testing.assert_allclose(box.at(uvw)[:, :2], blade, atol=1e-14)
    matrix = box.embed(nodes, uvw).matrix().toarray().reshape(len(nodes), 8, 2).sum(axis=2)
    np.testing.assert_allclose(np.transpose(ran["box"]), matrix, atol=1e-14)
    # The derivatives that it has of its own.
    h, design = 1e-5, best + np.linspace(-0.01, 0.01, 9)
    for function, slope in (
        (ran["narrowness"], ran["slope_of_narrowness"]),
        (ran["least_quality"], ran["slope_of_least_quality"]),
    ):
        wanted = [
            (function(design + h * unit) - function(design - h * unit)) / (2 * h)
            for unit in np.eye(9)
        ]
        found = slope(design)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-5 * np.abs(found).max())
