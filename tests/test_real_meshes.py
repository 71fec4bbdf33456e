"""Real meshes, deformed a little in every way that applies: no surprise, and boundaries kept.

The meshes are those of SU2's test cases; they are not part of the project, and the tests are
skipped where they are absent.
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.mesh.topology import find_boundary
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.frames import corners
from slideviz.rbf.reduction import Reduction
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup

FOLDER = Path(__file__).parents[1] / ".." / "shared" / "meshes" / "su2"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the real meshes are not here")

MESHES = {
    "cht fluid": ("coupled_cht_disc_adj_unsteadyCHT_cylinder_MeshCHT.su2", 1),
    "cht solid": ("coupled_cht_disc_adj_unsteadyCHT_cylinder_MeshCHT.su2", 2),
    "brick prism": ("deformation_brick_prism_mesh_brick_prism_ffd.su2", None),
    "brick tets": ("deformation_brick_tets_mesh_brick_tets_ffd.su2", None),
    "naca": ("disc_adj_euler_naca0012_pitching_mesh_NACA0012_inv_FFD.su2", None),
    "cylinder": ("disc_adj_rans_cylinder_mesh_cylinder.su2", None),
    "knowles": ("fea_fsi_MixElemsKnowles_mesh.su2", None),
    "rotating": ("fea_fsi_rotating_cylinder_cylinder.su2", None),
    "sphere": ("incomp_navierstokes_sphere_slice_2syms.su2", None),
    "adapted": ("mms_fvm_euler_TriAdapt.su2", None),
    "poiseuille": ("navierstokes_poiseuille_mesh_poiseuille_periodic.su2", None),
    "ls89": ("nicf_LS89_mesh_vki_turbine_prepbc.su2", None),
    "bath": ("nonequilibrium_thermalbath_frozen_5x5Mesh.su2", None),
    "channel": ("sliding_interface_channel_2D_channel_2D.su2", 1),
    "rotor": ("sliding_interface_channel_2D_channel_2D.su2", 2),
    "rotor core": ("sliding_interface_channel_2D_channel_2D.su2", 3),
    "bfm": ("turbomachinery_axial_stage_BFM_mesh.su2", None),
    "stator": ("turbomachinery_transonic_stator_2D_su2mesh_per.su2", None),
}

TURN, SHIFT = "turn", "shift"
Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
# Mesh, moving marker, its motion, periodic markers, their type and axis; the rest slides.
CASES = {
    "cylinder in a far field": ("cht fluid", "cylinder_fluid", TURN, "", "auto", Z),
    "far field around a sliding cylinder": ("cht fluid", "farfield", SHIFT, "", "auto", Z),
    "pin": ("cht solid", "inner_pin", SHIFT, "", "auto", Z),
    "brick of prisms": ("brick prism", "x_m", SHIFT, "y_m y_p", "translational", Z),
    "brick of tetrahedra": ("brick tets", "z_p", SHIFT, "x_m x_p", "translational", Z),
    "profile": ("naca", "airfoil", TURN, "", "auto", Z),
    "profile with a sharp edge slides": ("naca", "farfield", SHIFT, "", "auto", Z),
    "cylinder": ("cylinder", "Cylinder", SHIFT, "", "auto", Z),
    "tube with free walls": ("knowles", "load", SHIFT, "", "auto", Z),
    "tube with ends that match": ("knowles", "load", SHIFT, "", "auto", Z),
    "rotating ring": ("rotating", "inner", SHIFT, "per_1 per_2", "rotational", X),
    "sphere on the axis": (
        "sphere",
        "wall",
        SHIFT,
        "symmetry_left symmetry_right",
        "rotational",
        X,
    ),
    "adapted square": (
        "adapted",
        "PeriodicTop",
        SHIFT,
        "PeriodicLeft PeriodicRight",
        "translational",
        Z,
    ),
    "channel with periodic ends": ("poiseuille", "upper", SHIFT, "left right", "translational", Z),
    "turbine": ("ls89", "airfoil", TURN, "periodic_1 periodic_2", "translational", Z),
    "bath": ("bath", "left", SHIFT, "bottom top", "translational", Z),
    "channel": ("channel", "domain_interface", SHIFT, "", "auto", Z),
    "rotor": ("rotor", "internal_interface", TURN, "", "auto", Z),
    "rotor core": ("rotor core", "inner_interface", TURN, "", "auto", Z),
    "stage": ("bfm", "INLET", SHIFT, "PERIODIC_1 PERIODIC_2", "rotational", Z),
    "stator": ("stator", "airfoil", TURN, "periodic_1 periodic_2", "translational", Z),
}


@functools.cache
def load(name):
    file, zone = MESHES[name]
    mesh = sv.read(FOLDER / file, zone=zone)
    return mesh, sv.quality(mesh)


def make_case(name, sliding, periodic, rest="sliding"):
    which, moving, how, pair, kind, axis = CASES[name]
    mesh, _ = load(which)
    roles = dict.fromkeys(mesh.marker_names, rest) | {moving: "moving"}
    if periodic != "none" or kind == "rotational":
        roles |= dict.fromkeys(pair.split(), "periodic")
    size = float(np.ptp(mesh.points[mesh.marker(moving).nodes], axis=0).max())
    motion = Rotate(moving, 0.2)
    if how == SHIFT:
        # Along the axis of rotation: the one shift that is the same in every passage.
        along = np.array(axis if mesh.dim == 3 else (0.8, 0.6))[: mesh.dim]
        motion = Translate(moving, tuple(1e-3 * size * along))
    big = len(find_boundary(mesh).nodes) > 1500
    return mesh, Case(
        roles=roles,
        motions=(motion,),
        sliding=sliding,
        periodic=periodic,
        periodic_type=kind,
        axis=axis,
        steps=2,
        reduction=Reduction(1e-6 * mesh.extent) if big else None,
    )


LARGE = ("brick of prisms", "brick of tetrahedra", "sphere on the axis", "stage")


def runs():
    found = []
    for name, (*_, pair, _kind, _axis) in CASES.items():
        modes = ("none", "periodic", "fixed", "moving") if pair else ("none",)
        for way, sliding in enumerate(("none", "ps", "ds")):
            for k, mode in enumerate(modes):
                if (sliding, mode) != ("none", "moving"):
                    # Each mode by one method, "moving" by "ps".
                    once = not pair or (way + 2 * k) % 3 == 1
                    large = name in LARGE and mode != "moving"
                    marks = [pytest.mark.slow] if large or not once else []
                    found.append(pytest.param(name, sliding, mode, marks=marks))
    return found


@pytest.mark.parametrize(("name", "sliding", "periodic"), runs())
def test_a_small_deformation(name, sliding, periodic):
    mesh, case = make_case(name, sliding, periodic)
    check(mesh, case, load(CASES[name][0])[1])


@pytest.mark.parametrize("rest", ["internal", "fixed"])
@pytest.mark.parametrize("name", ["turbine", "stage", "rotating ring", "profile"])
def test_other_roles(name, rest):
    mesh, case = make_case(name, "ds", "moving" if CASES[name][3] else "none", rest)
    check(mesh, case, load(CASES[name][0])[1])


def check(mesh, case, before):
    *_, last = sv.deform(case, mesh)
    points = last.mesh.points
    assert np.all(np.isfinite(points))
    setup = make_setup(prepare(case, mesh))
    goal = setup.frame.points(setup.coords[setup.known] + setup.target)
    np.testing.assert_allclose(points[setup.known], goal, rtol=0, atol=1e-12 * mesh.extent)
    off_boundary(setup, points, mesh)
    if case.periodic in ("fixed", "moving"):
        images_stay(setup, points, mesh)
    after = sv.quality(last.mesh, mesh)
    assert after.inverted == 0
    assert after.min > 0.5 * before.min
    # Profiles with fine edges in a far field of 20 chords make systems nearly singular; the
    # channel's lower wall is a copy of the upper one, in a halo; walls that move leave other zones,
    # and the sliding walls beside them.
    known = ("nearly coincide", "halo copy", "so it was refined", "no longer fits")
    known += ("has left",)
    unknown = [text for text in last.warnings if not any(words in text for words in known)]
    assert not unknown


def off_boundary(setup, points, mesh):
    """Sliding nodes are on the undeformed boundary of their markers, one period on included."""
    coords, classes, fans = setup.frame.coords(points), setup.classes, setup.fans
    shift = setup.frame.shift()
    on = np.zeros((len(points), len(mesh.markers)), bool)
    on[classes.cluster_node[classes.row_cluster], fans.fan_marker[classes.row_fan]] = True
    gap = np.full(len(points), np.inf)
    for marker in range(len(mesh.markers)):
        nodes = np.flatnonzero(on[:, marker])
        if not len(nodes):
            continue
        facets = setup.boundary.facets[setup.boundary.marker == marker]
        side = corners(setup.coords, facets, setup.axis)
        if mesh.dim == 3:
            side = np.concatenate([side[:, :3], side[:, [0, 2, 3]]])
        track = ClosestPoints(side)
        for step in np.arange(-1, 2)[:, None] * shift:
            at = coords[nodes] + step
            gap[nodes] = np.minimum(gap[nodes], np.linalg.norm(track.query(at) - at, axis=1))
    # On the axis every angle is the same place.
    assert not coords[setup.axis, 0].any()
    sliding = classes.sliding[~setup.axis[classes.sliding]]
    assert np.isfinite(gap[sliding]).all()
    # Images move alike, so one of them may be off by what the two boundaries differ.
    differ = 2.0 * max((pair.mismatch for pair in setup.pairs), default=0.0)
    assert gap[sliding].max(initial=0.0) < 1e-9 * mesh.extent + differ * bool(len(setup.images))


def images_stay(setup, points, mesh):
    coords = setup.frame.coords(points)
    before = setup.coords[setup.images[:, 1]] - setup.coords[setup.images[:, 0]]
    after = coords[setup.images[:, 1]] - coords[setup.images[:, 0]]
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * mesh.extent)
