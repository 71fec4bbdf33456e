"""Work in turns of the event loop."""

import threading

import pytest
from qtpy.QtCore import QTimer

from slideviz.errors import Cancelled
from slideviz.gui.responsiveness.turns import Turns
from slideviz.session.pieces import Beside


@pytest.fixture
def turns(qtbot):
    made = Turns()
    yield made
    made.stop()


class Told:
    def __init__(self, turns):
        self.all = []
        turns.came.connect(lambda value: self.all.append(("came", value)))
        turns.done.connect(lambda value: self.all.append(("done", value)))
        turns.failed.connect(lambda error: self.all.append(("failed", str(error))))


def test_what_draws_is_done_here_and_the_rest_beside(turns, qtbot):
    told, threads = Told(turns), []

    def work():
        threads.append(threading.current_thread())
        other = yield Beside(lambda _: threading.current_thread())
        yield None
        threads.append(threading.current_thread())
        yield 7
        return other

    turns.start(work())
    assert not threads, "in the next turn"
    assert turns.busy
    qtbot.waitUntil(lambda: not turns.busy)
    assert threads == [threading.main_thread()] * 2
    assert told.all[0] == ("came", 7)
    assert told.all[1][0] == "done"
    assert told.all[1][1] not in (None, threading.main_thread())
    assert len(told.all) == 2


def test_the_event_loop_goes_on_between_pieces(turns, qtbot):
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

    turns.start(work())
    qtbot.waitUntil(lambda: not turns.busy)
    assert seen == sorted(set(seen)), "a tick between each two"


@pytest.mark.parametrize("beside", [False, True])
def test_what_goes_wrong_is_told_once(turns, qtbot, beside):
    told = Told(turns)

    def fail(_=None):
        raise ValueError("wrong")

    def work():
        if beside:
            yield Beside(fail)
        else:
            yield None
            fail()

    turns.start(work())
    qtbot.waitUntil(lambda: not turns.busy)
    qtbot.wait(20)
    assert told.all == [("failed", "wrong")]


def test_an_error_beside_can_be_caught_by_the_work(turns, qtbot):
    told = Told(turns)

    def work():
        try:
            yield Beside(lambda _: 1 / 0)
        except ZeroDivisionError:
            return "caught"

    turns.start(work())
    qtbot.waitUntil(lambda: not turns.busy)
    assert told.all == [("done", "caught")]


def test_stopping_ends_what_is_done_beside_and_tells_nothing(turns, qtbot):
    told, begun, ends = Told(turns), threading.Event(), []

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
            yield Beside(slow)
        finally:
            ends.append("work")

    turns.start(work())
    qtbot.waitUntil(begun.is_set)
    turns.stop()
    assert ends == ["beside", "work"]
    assert not turns.busy
    turns.start(iter_of("next"))
    qtbot.waitUntil(lambda: not turns.busy)
    assert told.all == [("done", "next")]


def test_other_work_takes_the_place_of_what_goes_on(turns, qtbot):
    told, ends = Told(turns), []

    def endless():
        try:
            while True:
                yield None
        finally:
            ends.append("first")

    turns.start(endless())
    qtbot.wait(20)
    turns.start(iter_of("second"))
    assert ends == ["first"]
    qtbot.waitUntil(lambda: not turns.busy)
    assert told.all == [("done", "second")]


def iter_of(value):
    yield None
    return value
