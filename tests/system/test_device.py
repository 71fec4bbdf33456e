"""DEVICE: where a run is computed, and what it says where there is no card."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import doctor_command
from slideviz.errors import CaseError, DeformError
from slideviz.rbf import card
from slideviz.solver import setup
from slideviz.solver.prepare import prepare
from slideviz.system import device
from tests import builders
from tests.fake_cupy import fake_cupy, forget, needs_compiler

__all__ = ["fake_cupy"]

ROOT = Path(__file__).parents[2]


def square():
    mesh = builders.square(12)
    roles = {"BLOCK": "moving"}
    move = sv.Translate("BLOCK", (0.04, 0.02))
    return mesh, sv.Case(roles=roles, motions=(move,))


def moved(mesh, case):
    *_, last = sv.deform(case, mesh)
    return last


def test_a_case_file_has_it(tmp_path):
    file = tmp_path / "a.cfg"
    file.write_text("DEVICE= gpu\n")
    assert sv.Case.read(file).device == "gpu"
    file.write_text("DEVICE= card\n")
    with pytest.raises(CaseError, match=r"DEVICE.*card.*auto.*cpu.*gpu"):
        sv.Case.read(file)


@pytest.fixture
def none_installed(monkeypatch):
    monkeypatch.setattr(device, "find_spec", lambda _: None)
    forget()
    yield
    forget()


def test_without_cupy_the_error_has_the_line_that_installs_it(none_installed):
    assert device.choose_place("auto") == device.choose_place("cpu") == "cpu"
    with pytest.raises(DeformError, match="CuPy is not installed") as error:
        device.choose_place("gpu")
    assert str(error.value) == (
        'DEVICE= GPU: CuPy is not installed; pip install "slideviz[gpu]", or use DEVICE= CPU'
    )
    assert error.value.messages[0].keys == ("DEVICE",)


def test_without_a_card_it_says_so(fake_cupy, monkeypatch):
    module = fake_cupy(count=0)
    assert device.choose_place("auto") == "cpu"
    with pytest.raises(DeformError, match="this machine has no card of NVIDIA; use another"):
        device.choose_place("gpu")

    def fail():
        raise OSError("cudaErrorInsufficientDriver")

    monkeypatch.setattr(module.cuda.runtime, "getDeviceCount", fail)
    forget()
    assert device.choose_place("auto") == "cpu"
    with pytest.raises(DeformError, match=r"no card \(cudaErrorIns.*; install NVIDIA's driver, or"):
        device.choose_place("gpu")


def test_a_run_without_a_card_ends_in_words(none_installed):
    mesh, case = square()
    with pytest.raises(DeformError, match="DEVICE= GPU: CuPy is not installed"):
        moved(mesh, case.change(device="gpu"))
    moved(mesh, case.change(device="gpu", method="idw"))  # which uses none
    wanted = moved(mesh, case.change(device="cpu")).mesh.points
    assert np.array_equal(moved(mesh, case).mesh.points, wanted)


@pytest.mark.skipif(find_spec("cupy") is not None, reason="CuPy is installed")
def test_nothing_is_imported_without_cupy():
    script = """
import sys
from tests.system.test_device import moved, square
moved(*square())
print([name for name in sys.modules if name.split(".")[0] in ("cupy", "cupyx")])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.splitlines()[-1] == "[]"


@needs_compiler
@pytest.mark.parametrize("settings", [{}, {"reduction": sv.Reduction(tolerance=1e-3)}])
def test_runs_on_a_card_are_those_of_the_processor(fake_cupy, monkeypatch, settings):
    mesh, case = square()
    wanted = moved(mesh, case.change(device="cpu", **settings))
    fake_cupy()
    calls = []
    run_on_card = card._run
    monkeypatch.setattr(
        card, "_run", lambda name, *rest: calls.append(name) or run_on_card(name, *rest)
    )
    for wish in ("auto", "gpu"):
        found = moved(mesh, case.change(device=wish, **settings))
        assert {"add_up", "fill_matrix"} == set(calls)
        calls.clear()
        assert found.control_nodes == wanted.control_nodes
        np.testing.assert_allclose(found.mesh.points, wanted.mesh.points, rtol=0, atol=1e-12)
    moved(mesh, case.change(device="cpu", **settings))
    assert not calls


@needs_compiler
def test_derivatives_and_designs_are_those_of_the_processor(fake_cupy):
    mesh, case = square()
    fake_cupy()
    results = []
    for wish in ("cpu", "gpu"):
        deformer = sv.Deformer(mesh, case.change(device=wish))
        first = deformer.displacement
        designs = np.stack([first, 0.5 * first, -first])
        weights = np.ones(mesh.points.shape)
        results.append([deformer.deform(designs), deformer.vjp(first, weights)])
    for found, wanted in zip(*results, strict=True):
        size = max(1.0, np.abs(wanted).max())  # the system's condition enlarges rounding
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * size)


def test_data_reduction_auto_takes_all_nodes_as_far_as_memory_goes(fake_cupy, monkeypatch):
    mesh, case = square()
    prepared = prepare(case, mesh)
    monkeypatch.setattr(setup, "EXACT_NODES", 4)
    count = setup.make_setup(prepare(case.change(device="cpu"), mesh)).candidates
    assert setup.make_setup(prepare(case.change(device="cpu"), mesh)).reduction is not None
    enough = int(setup.SYSTEM_BYTES * (count + 0.5) ** 2)
    fake_cupy(free=enough)
    assert setup.make_setup(prepared).reduction is None
    sliding = prepare(case.change(sliding="ds"), mesh)  # a system for both axes
    assert setup.make_setup(sliding).reduction is not None
    fake_cupy(free=enough // 2)
    assert setup.make_setup(prepared).reduction is not None
    monkeypatch.setattr(setup, "free_memory", lambda: float(enough // 2))
    fake_cupy(free=enough)
    assert setup.make_setup(prepared).reduction is not None


def test_the_doctor_names_card_or_remedy(monkeypatch, fake_cupy):
    forget()
    with monkeypatch.context() as patch:
        patch.setattr(device, "find_spec", lambda _: None)
        rows = dict(doctor_command.SECTIONS["computing"](None))
    assert rows == {"GPU": 'none used: CuPy is not installed; pip install "slideviz[gpu]"'}
    fake_cupy()
    assert dict(doctor_command.SECTIONS["computing"](None)) == {"GPU": "Fake, 2 GiB"}
