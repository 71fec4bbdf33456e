"""Blocks worked on in threads: their results in order, and no thread left behind."""

import threading
import time

import pytest

from slideviz.formats.files import read, write
from slideviz.system.threads import ordered_map
from tests.formats.su2_samples import SOLID, save


@pytest.fixture(params=[1, 2, 5], autouse=True)
def threads(request, monkeypatch):
    monkeypatch.setattr("slideviz.system.threads.get_num_threads", lambda: request.param)
    return request.param


def block_threads() -> int:
    return sum(thread.name.startswith("slideviz-blocks") for thread in threading.enumerate())


def test_results_come_in_order_whichever_is_done_first():
    def work(task: int) -> int:
        time.sleep(0.01 * (task % 3 == 0))
        return task * task

    assert list(ordered_map(work, range(20))) == [task * task for task in range(20)]
    assert list(ordered_map(work, [])) == []
    assert block_threads() == 0


def test_the_first_error_in_order_is_raised_after_the_results_before_it():
    def work(task: int) -> int:
        if task in (3, 4):
            time.sleep(0.02 * (task == 3))
            raise ValueError(task)
        return task

    seen = []
    with pytest.raises(ValueError, match="3"):
        seen += ordered_map(work, range(9))
    results = ordered_map(work, range(9))
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="3"):
        next(results)
    assert block_threads() == 0


def test_only_some_tasks_are_done_ahead(threads):
    begun = []
    results = ordered_map(begun.append, range(1000))
    next(results)
    time.sleep(0.05)
    assert len(begun) <= 2 * threads + 1
    results.close()
    assert block_threads() == 0


def test_all_threads_work_at_once(threads):
    together = threading.Barrier(threads)
    assert len(list(ordered_map(lambda _: together.wait(100), range(2 * threads)))) == 2 * threads


@pytest.mark.parametrize("calls", [1, 2, 7])
def test_writing_that_is_stopped_leaves_neither_threads_nor_files(tmp_path, monkeypatch, calls):
    for name in ("su2.text", "su2.write"):
        monkeypatch.setattr(f"slideviz.formats.{name}.BLOCK_BYTES", 16)
    mesh = read(save(tmp_path, SOLID))
    seen = []

    def going_on() -> None:
        seen.append(None)
        if len(seen) == calls:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "out.su2", mesh.with_points(mesh.points / 3), going_on=going_on)
    assert [path.name for path in tmp_path.iterdir()] == ["grid.su2"]
    assert block_threads() == 0


def test_the_number_of_threads_changes_nothing(tmp_path, monkeypatch):
    for name in ("su2.text", "su2.write"):
        monkeypatch.setattr(f"slideviz.formats.{name}.BLOCK_BYTES", 16)
    mesh = read(save(tmp_path, SOLID))
    write(tmp_path / "out.su2", mesh.with_points(mesh.points * 1.0))
    assert (tmp_path / "out.su2").read_text() == SOLID
