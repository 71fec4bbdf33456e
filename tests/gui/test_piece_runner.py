"""Jobs in pieces, in turns of the event loop and beside the window."""

import threading

import pytest
from qtpy.QtCore import QTimer

from slideviz.errors import Cancelled
from slideviz.gui.responsiveness.worker import PieceRunner
from slideviz.session.pieces import InThread


@pytest.fixture
def runner(qtbot):
    made = PieceRunner()
    yield made
    made.stop()


class Emitted:
    def __init__(self, runner):
        self.all = []
        runner.yielded.connect(lambda value: self.all.append(("came", value)))
        runner.done.connect(lambda value: self.all.append(("done", value)))
        runner.failed.connect(lambda error: self.all.append(("failed", str(error))))


def test_what_draws_is_done_here_and_the_rest_beside(runner, qtbot):
    emitted, threads = Emitted(runner), []

    def work():
        threads.append(threading.current_thread())
        other = yield InThread(lambda _: threading.current_thread())
        yield None
        threads.append(threading.current_thread())
        yield 7
        return other

    runner.start(work())
    assert not threads, "in the next turn"
    assert runner.busy
    qtbot.waitUntil(lambda: not runner.busy)
    assert threads == [threading.main_thread()] * 2
    assert emitted.all[0] == ("came", 7)
    assert emitted.all[1][0] == "done"
    assert emitted.all[1][1] not in (None, threading.main_thread())
    assert len(emitted.all) == 2


def test_the_event_loop_goes_on_between_pieces(runner, qtbot):
    ticks, seen = [], []
    timer = QTimer()
    timer.timeout.connect(lambda: ticks.append(1))
    timer.start(1)

    def work():
        for _ in range(5):
            seen.append(len(ticks))
            while not timer.remainingTime() <= 0:
                pass
            yield None

    runner.start(work())
    qtbot.waitUntil(lambda: not runner.busy)
    assert seen == sorted(set(seen)), "a tick between each two"


@pytest.mark.parametrize("beside", [False, True])
def test_what_goes_wrong_is_told_once(runner, qtbot, beside):
    emitted = Emitted(runner)

    def fail(_=None):
        raise ValueError("wrong")

    def work():
        if beside:
            yield InThread(fail)
        else:
            yield None
            fail()

    runner.start(work())
    qtbot.waitUntil(lambda: not runner.busy)
    qtbot.wait(20)
    assert emitted.all == [("failed", "wrong")]


def test_an_error_beside_can_be_caught_by_the_work(runner, qtbot):
    emitted = Emitted(runner)

    def work():
        try:
            yield InThread(lambda _: 1 / 0)
        except ZeroDivisionError:
            return "caught"

    runner.start(work())
    qtbot.waitUntil(lambda: not runner.busy)
    assert emitted.all == [("done", "caught")]


def test_stopping_ends_what_is_done_beside_and_tells_nothing(runner, qtbot):
    emitted, begun, ends = Emitted(runner), threading.Event(), []

    def slow(going_on):
        begun.set()
        try:
            while True:
                going_on()
        except Cancelled:
            ends.append("beside")
            raise

    def work():
        try:
            yield InThread(slow)
        finally:
            ends.append("work")

    runner.start(work())
    qtbot.waitUntil(begun.is_set)
    runner.stop()
    assert ends == ["beside", "work"]
    assert not runner.busy
    runner.start(iter_of("next"))
    qtbot.waitUntil(lambda: not runner.busy)
    assert emitted.all == [("done", "next")]


def test_other_work_takes_the_place_of_what_goes_on(runner, qtbot):
    emitted, begun, ends = Emitted(runner), threading.Event(), []

    def endless():
        begun.set()
        try:
            while True:
                yield None
        finally:
            ends.append("first")

    runner.start(endless())
    qtbot.waitUntil(begun.is_set)
    runner.start(iter_of("second"))
    assert ends == ["first"]
    qtbot.waitUntil(lambda: not runner.busy)
    assert emitted.all == [("done", "second")]


def iter_of(value):
    yield None
    return value
