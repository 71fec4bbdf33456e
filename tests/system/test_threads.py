"""Work in parts: all of it once, whatever the parts, and what is raised ends it."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from slideviz.mesh import orientation
from slideviz.mesh.quality import quality
from slideviz.system import threads
from slideviz.system.threads import in_parts
from tests.mesh.test_quality import shaken, soup


@pytest.mark.parametrize("cores", [1, 2, 7])
@pytest.mark.parametrize("count", [0, 1, 9, 10, 11, 1003])
def test_every_row_is_worked_on_once(monkeypatch, cores, count):
    monkeypatch.setattr(threads, "PART", 10)
    monkeypatch.setattr(threads, "cores", lambda: cores)
    seen = np.zeros(count, int)

    def work(part):
        seen[part] += 1

    in_parts(work, count)
    assert (seen == 1).all()


@pytest.mark.parametrize("cores", [1, 3])
def test_what_is_raised_ends_the_work(monkeypatch, cores):
    monkeypatch.setattr(threads, "PART", 1)
    monkeypatch.setattr(threads, "cores", lambda: cores)
    done = []

    def fail(part):
        done.append(part.start)
        raise ValueError("no more")

    with pytest.raises(ValueError, match="no more"):
        in_parts(fail, 1000)
    assert len(done) <= cores

    stopped = threading.Event()

    def stop(fraction):
        stopped.set()
        raise KeyboardInterrupt

    def work(part):  # other threads would take all parts while the first one waits for its turn
        assert stopped.wait(60)
        done.append(part.start)

    done.clear()
    with pytest.raises(KeyboardInterrupt):
        in_parts(work, 300_000, stop)
    assert len(done) < 299_999  # the part of the thread that stops is not done anyway


@pytest.mark.parametrize("vtk", [5, 9, 10, 12, 13, 14])
def test_quality_is_the_same_for_any_cores(monkeypatch, vtk):
    monkeypatch.setattr(threads, "PART", 7)
    mesh, before = soup(vtk, shaken(vtk, 100, 0.3)), soup(vtk, shaken(vtk, 100, 0.1, seed=1))
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(threads, "cores", lambda cores=cores: cores)
        found.append(quality(mesh, before))
    for name in ("values", "size", "skew", "status"):
        np.testing.assert_array_equal(*(getattr(one, name) for one in found))


def test_a_reference_is_measured_once(monkeypatch):
    calls = []
    measured = orientation.corner_sums
    monkeypatch.setattr(
        orientation, "corner_sums", lambda mesh: calls.append(mesh) or measured(mesh)
    )
    mesh, before = soup(12, shaken(12, 9, 0.2)), soup(12, shaken(12, 9, 0.1, seed=1))
    first, second = quality(mesh, before), quality(mesh, before)
    quality(before)
    assert calls == [before]
    np.testing.assert_array_equal(first.values, second.values)
