"""What all tests share."""

import gc
import os

import pytest
from hypothesis import settings

from tests.portable import POSIX_ONLY, rules

if os.environ.get("SLIDEVIZ_TESTS") == "portable":
    rules.install()

# No test fails because a machine was busy for a moment.
settings.register_profile("slideviz", deadline=None)
settings.load_profile("slideviz")

# Workers share the cores: threads of BLAS that wait for each other cost a third of the time.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Many tests start the program, which would compile each of its modules anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Plotters, scenes and small meshes that the tests of several packages draw.
pytest_plugins = ["tests.scenes"]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Return one process more than cores: where one waits for a program or a timer, it works."""
    affinity = getattr(os, "sched_getaffinity", None)
    return (len(affinity(0)) if affinity else os.cpu_count() or 1) + 1


def pytest_collection_modifyitems(items):
    """Leave out what is not so under the rules of Windows."""
    for item in items if os.environ.get("SLIDEVIZ_TESTS") == "portable" else ():
        if reason := POSIX_ONLY.get(item.name.partition("[")[0]):
            item.add_marker(pytest.mark.skip(reason=reason))


def pytest_collection_finish():
    """Look for garbage less often, and not at modules and collected tests: it took long."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(5_000, 10, 10)


@pytest.fixture(autouse=True)
def _no_word_of_compiling(request, monkeypatch):
    """What a command says does not depend on what was compiled before, but in tests of that."""
    if "compil" not in request.node.name:
        monkeypatch.setattr("slideviz.cli.progress.say_compiling", lambda: None)
