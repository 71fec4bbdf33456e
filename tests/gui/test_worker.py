import threading

import pytest

from slideviz.errors import Cancelled, DeformError
from slideviz.gui.responsiveness.worker import JobRunner


@pytest.fixture
def runner(qtbot):
    made = JobRunner()
    yield made
    made.close()


class Ears:
    def __init__(self, runner):
        self.ends, self.doing, self.kept, self.threads = [], [], [], set()
        runner.finished.connect(lambda value: self.end("finished", value))
        runner.cancelled.connect(lambda: self.end("cancelled", None))
        runner.failed.connect(lambda error: self.end("failed", error))
        runner.progressed.connect(self.doing.append)
        runner.yielded.connect(self.kept.extend)

    def end(self, *what):
        self.ends.append(what)
        self.threads.add(threading.current_thread())


def finish(qtbot, runner):
    qtbot.waitUntil(lambda: not runner.busy)
    qtbot.wait(30)


def test_a_job_ends_with_finished_in_the_windows_thread(runner, qtbot):
    ears = Ears(runner)
    runner.start(lambda a, b, job: a + b, 2, 3)
    finish(qtbot, runner)
    assert ears.ends == [("finished", 5)]
    assert ears.threads == {threading.main_thread()}


def test_every_kept_item_is_delivered_before_the_end_and_only_the_newest_news(runner, qtbot):
    ears, order = Ears(runner), []
    runner.yielded.connect(lambda items: order.append(len(items)))
    runner.finished.connect(lambda _: order.append("end"))

    def work(job):
        for i in range(500):
            job.progress(str(i), i / 500)
            job.report(i)

    runner.start(work)
    finish(qtbot, runner)
    assert ears.kept == list(range(500))
    assert ears.doing[-1].text == "499"
    assert len(ears.doing) < 500
    assert order[-1] == "end"


def test_cancel_ends_a_job_with_cancelled_only(runner, qtbot):
    ears, started = Ears(runner), threading.Event()

    def work(job):
        started.set()
        while not job.stopped():
            pass
        raise Cancelled("stopped")

    runner.start(work)
    assert started.wait(100)
    runner.cancel()
    finish(qtbot, runner)
    assert ears.ends == [("cancelled", None)]


@pytest.mark.parametrize("error", [DeformError("singular"), ZeroDivisionError("odd")])
def test_whatever_goes_wrong_is_told_once(runner, qtbot, error):
    ears = Ears(runner)

    def work(job):
        raise error

    runner.start(work)
    finish(qtbot, runner)
    assert ears.ends == [("failed", error)]


def test_the_next_job_is_not_cancelled_by_the_last_one(runner, qtbot):
    ears = Ears(runner)
    runner.start(lambda job: 1)
    runner.cancel()
    finish(qtbot, runner)
    runner.start(lambda job: job.stopped())
    finish(qtbot, runner)
    assert ears.ends[-1] == ("finished", False)


def test_closing_stops_the_job_and_waits_for_it(qtbot):
    runner, ended = JobRunner(), threading.Event()
    ears = Ears(runner)

    def work(job):
        while not job.stopped():
            pass
        ended.set()

    runner.start(work)
    runner.close()
    assert ended.is_set()
    qtbot.wait(30)
    assert ears.ends == []
