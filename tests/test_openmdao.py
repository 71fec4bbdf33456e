"""The deformation as a component of OpenMDAO and in the scenarios of MPhys."""

import subprocess
import sys

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.errors import MeshError
from tests.builders import grid

om = pytest.importorskip("openmdao.api")
pytest.importorskip("mphys")

from mphys import Builder, Multipoint  # noqa: E402
from mphys.scenarios import ScenarioAerodynamic  # noqa: E402
from openmdao.utils.assert_utils import assert_check_partials, assert_check_totals  # noqa: E402

from slideviz.openmdao import MeshDeformation, MeshDeformationBuilder  # noqa: E402
from slideviz.samples.table import write_sample  # noqa: E402

HOLE = ((1, 3), (1, 3), (1, 3))


@pytest.fixture(autouse=True)
def no_files_of_openmdao(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OPENMDAO_REPORTS", "0")
    monkeypatch.setenv("OPENMDAO_USE_MPI", "0")


def deformer_of(dim=2, **values):
    mesh = grid((4,) * dim, hole=HOLE[:dim])
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    motions = (sv.Translate("BLOCK", (0.03, -0.02, 0.02)[:dim]),)
    return sv.Deformer(mesh, Case(roles=roles, motions=motions, sliding="ps", **values))


def moved_surface(deformer, amount=0.03, seed=0):
    start = deformer.mesh.points[deformer.nodes]
    return start + amount * np.random.default_rng(seed).uniform(-1, 1, start.shape)


def problem_of(model):
    problem = om.Problem(model, reports=False)
    problem.setup()
    return problem


def one(deformer, **options):
    model = om.Group()
    model.add_subsystem("mesh", MeshDeformation(deformer=deformer, **options), promotes=["*"])
    problem = problem_of(model)
    problem.set_val("x_aero", moved_surface(deformer).ravel())
    return problem


@pytest.mark.parametrize(("dim", "steps"), [(2, 1), (2, 3), (3, 1)])
def test_the_component_gives_what_the_deformer_gives(dim, steps):
    deformer = deformer_of(dim, steps=steps)
    problem = one(deformer, quality=True, margin=True, p=20.0)
    problem.run_model()
    points = deformer.deform(moved_surface(deformer) - deformer.mesh.points[deformer.nodes])
    np.testing.assert_array_equal(problem.get_val("aero_vol_coords"), points.ravel())
    found = sv.quality(
        deformer.mesh.with_points(points), deformer.mesh, derivative=True, p=20.0
    ).derivative
    assert problem.get_val("minimum_quality")[0] == found.minimum
    assert problem.get_val("mean_quality")[0] == found.mean
    moved = moved_surface(deformer) - deformer.mesh.points[deformer.nodes]
    margin = deformer.constraint("margin", moved, p=20.0).value
    assert problem.get_val("minimum_margin")[0] == pytest.approx(margin, abs=1e-14)


def test_before_it_runs_it_has_the_undeformed_mesh():
    deformer = deformer_of()
    model = om.Group()
    model.add_subsystem("mesh", MeshDeformation(deformer=deformer), promotes=["*"])
    problem = problem_of(model)
    problem.final_setup()
    start = deformer.mesh.points
    np.testing.assert_array_equal(problem.get_val("x_aero"), start[deformer.nodes].ravel())
    np.testing.assert_array_equal(problem.get_val("aero_vol_coords"), start.ravel())


@pytest.mark.parametrize("steps", [1, 2])
def test_two_scenarios_in_one_model_have_exact_partials_forward_and_reverse(steps):
    deformer = deformer_of(steps=steps)
    model = om.Group()
    for k in range(2):
        part = MeshDeformation(deformer=deformer, quality=True, margin=True, p=10.0)
        model.add_subsystem(f"scenario{k}", part)
    problem = problem_of(model)
    for k in range(2):
        problem.set_val(f"scenario{k}.x_aero", moved_surface(deformer, seed=k).ravel())
    problem.run_model()
    checked = problem.check_partials(out_stream=None, form="central", step=1e-6)
    assert len(checked) == 2
    for pairs in checked.values():
        names = {"aero_vol_coords", "minimum_quality", "mean_quality", "minimum_margin"}
        assert {of for of, _ in pairs} == names
        assert all(found["J_fwd"].any() and found["J_rev"].any() for found in pairs.values())
    assert_check_partials(checked, atol=2e-7, rtol=2e-7)


def test_partials_can_be_checked_at_the_undeformed_mesh(tmp_path):
    write_sample("square", tmp_path, 8)
    mesh, case = sv.read(tmp_path / "mesh.su2"), sv.Case.read(tmp_path / "square.cfg")
    model = om.Group()
    model.add_subsystem("mesh", MeshDeformation(deformer=sv.Deformer(mesh, case.change(steps=1))))
    problem = problem_of(model)
    problem.run_model()
    checked = problem.check_partials(out_stream=None, form="central", step=1e-6)
    assert_check_partials(checked, atol=1e-6, rtol=1e-6)


class Sum(om.ExplicitComponent):
    """A flow solver, as far as the mesh is concerned: a function of all points."""

    def initialize(self):
        self.options.declare("weights")

    def setup(self):
        weights = self.options["weights"]
        self.add_input("aero_vol_coords", shape=weights.shape, tags=["mphys_coupling"])
        self.add_output("drag", tags=["mphys_result"])
        self.declare_partials("drag", "aero_vol_coords", val=weights)

    def compute(self, inputs, outputs):
        outputs["drag"] = self.options["weights"] @ inputs["aero_vol_coords"]


class SumBuilder(Builder):
    def __init__(self, weights):
        self.weights, self.ready = weights, False

    def initialize(self, comm):
        self.ready = True

    def get_coupling_group_subsystem(self, scenario_name=None):
        assert self.ready
        return Sum(weights=self.weights)


class Design(Multipoint):
    """Two scenarios of one builder, whose surfaces are scaled by a number each."""

    def initialize(self):
        self.options.declare("builder")

    def setup(self):
        builder = self.options["builder"]
        builder.initialize(self.comm)
        self.add_subsystem("mesh", builder.get_mesh_coordinate_subsystem())
        size = builder.get_number_of_nodes() * builder.get_ndof()
        for name in ("cruise", "climb"):
            scaled = om.ExecComp("x = a * x0", x=np.zeros(size), x0=np.zeros(size), a=1.0)
            self.add_subsystem(f"shape_{name}", scaled)
            self.connect("mesh.x_aero0_mesh", f"shape_{name}.x0")
            self.mphys_add_scenario(name, ScenarioAerodynamic(aero_builder=builder))
            self.connect(f"shape_{name}.x", f"{name}.x_aero")


@pytest.mark.parametrize("mode", ["fwd", "rev"])
@pytest.mark.parametrize("in_coupling", [False, True])
def test_scenarios_of_mphys_deform_before_their_solver(mode, in_coupling):
    deformer = deformer_of()
    weights = np.random.default_rng(1).normal(size=deformer.mesh.points.size)
    builder = MeshDeformationBuilder(
        deformer, SumBuilder(weights), in_coupling=in_coupling, quality=True
    )
    problem = om.Problem(Design(builder=builder), reports=False)
    problem.setup(mode=mode)
    problem.set_val("shape_cruise.a", 1.02)
    problem.set_val("shape_climb.a", 0.97)
    problem.run_model()
    start = deformer.mesh.points[deformer.nodes]
    for name, a in (("cruise", 1.02), ("climb", 0.97)):
        points = deformer.deform((a - 1) * start)
        assert problem.get_val(f"{name}.drag")[0] == pytest.approx(weights @ points.ravel())
    of = ["cruise.drag", "climb.drag", "cruise.minimum_quality", "climb.mean_quality"]
    checked = problem.check_totals(
        of, ["shape_cruise.a", "shape_climb.a"], out_stream=None, form="central", step=1e-6
    )
    assert_check_totals(checked, atol=1e-6, rtol=1e-6)


def test_a_builder_without_a_solver_has_the_deformation_for_its_coupling():
    deformer = deformer_of()
    builder = MeshDeformationBuilder(deformer)
    problem = om.Problem(Design(builder=builder), reports=False)
    problem.setup()
    problem.set_val("shape_cruise.a", 1.02)
    problem.run_model()
    start = deformer.mesh.points[deformer.nodes]
    moved = problem.get_val("cruise.aero_vol_coords").reshape(-1, 2)
    np.testing.assert_allclose(moved[deformer.nodes], 1.02 * start, rtol=1e-12)
    assert builder.get_pre_coupling_subsystem() is None
    assert builder.get_post_coupling_subsystem() is None


def test_the_builder_tells_nodes_and_those_of_a_boundary():
    deformer = deformer_of(3)
    builder = MeshDeformationBuilder(deformer)
    assert builder.get_number_of_nodes() == len(deformer.nodes)
    assert builder.get_ndof() == 3
    np.testing.assert_array_equal(
        builder.get_tagged_indices(["BLOCK"]), np.arange(len(deformer.nodes))
    )
    assert len(builder.get_tagged_indices(["x_m"])) == 0
    with pytest.raises(MeshError, match="no marker 'WING'; the mesh has x_m, x_p"):
        builder.get_tagged_indices(["WING"])


@pytest.mark.filterwarnings("ignore:.*no distributed vector implementation")
def test_it_takes_a_distributed_surface_on_one_process():
    deformer = deformer_of()

    class Geometry(om.ExplicitComponent):
        def setup(self):
            self.add_output("x_aero", moved_surface(deformer).ravel(), distributed=True)

    model = om.Group()
    model.add_subsystem("geometry", Geometry(), promotes=["*"])
    model.add_subsystem("mesh", MeshDeformation(deformer=deformer), promotes=["*"])
    problem = problem_of(model)
    problem.run_model()
    moved = problem.get_val("aero_vol_coords").reshape(-1, 2)
    np.testing.assert_allclose(moved[deformer.nodes], moved_surface(deformer), rtol=1e-12)


def test_what_the_deformer_refuses_is_an_analysis_error(monkeypatch):
    deformer = deformer_of()
    problem = one(deformer)

    def refuse(displacement):
        raise MeshError("a surface that cannot be followed; move it less")

    monkeypatch.setattr(type(deformer), "deform", lambda self, displacement: refuse(displacement))
    with pytest.raises(om.AnalysisError, match="cannot be followed; move it less"):
        problem.run_model()


def test_another_deformer_can_be_given_between_runs():
    deformer = deformer_of()
    problem = one(deformer, quality=True)
    problem.run_model()
    surface = moved_surface(deformer)
    other = deformer.refresh(surface - deformer.mesh.points[deformer.nodes])
    problem.model.mesh.options["deformer"] = other
    problem.run_model()
    points = other.deform(surface - deformer.mesh.points[deformer.nodes])
    np.testing.assert_array_equal(problem.get_val("aero_vol_coords"), points.ravel())


def test_without_openmdao_it_says_what_to_install():
    script = "import sys; sys.modules['openmdao'] = None; import slideviz.openmdao"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "pip install 'slideviz[openmdao]'" in done.stderr
    quiet = "import slideviz, sys; slideviz.quality; assert 'openmdao' not in sys.modules"
    subprocess.run([sys.executable, "-c", quiet], check=True)
