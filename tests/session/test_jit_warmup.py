import pytest

from slideviz.baselines import idw
from slideviz.elastic import laplacian, stiffness
from slideviz.rbf import closest, compiled
from slideviz.session import jit_warmup
from slideviz.session.jobs import Job


def signatures():
    return {
        name: len(loop.signatures)
        for module in (compiled, closest, idw, laplacian, stiffness)
        for name, loop in vars(module).items()
        if hasattr(loop, "signatures")
    }


def test_it_makes_the_loops_ready_that_runs_use():
    jit_warmup.warm_up(lambda: None, Job())
    ready = signatures()
    for name in ("fill_matrix", "sum_plain", "_build", "_query"):
        assert ready[name], name
    for name in ("weigh", "volumes", "add", "forward", "backward"):
        assert ready[name], name


def test_nothing_is_told_when_nothing_is_compiled():
    jit_warmup.warm_up(lambda: None, Job())
    told = []
    jit_warmup.warm_up(lambda: told.append(1), Job())
    assert not told


def test_compilation_is_told():
    import numba

    told = []

    @numba.njit
    def fresh(x):
        return x + 1

    def deform(name, sliding, job):
        fresh(len(name))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jit_warmup, "_deform", deform)
        jit_warmup.warm_up(lambda: told.append(1), Job())
    assert told


def test_it_stops_when_asked_and_swallows_what_the_run_would_tell(monkeypatch):
    from slideviz.errors import CaseError

    done = []

    def deform(name, sliding, job):
        done.append(name)
        raise CaseError("wrong")

    monkeypatch.setattr(jit_warmup, "_deform", deform)
    jit_warmup.warm_up(lambda: None, Job(stopped=lambda: True))
    assert not done
    jit_warmup.warm_up(lambda: None, Job())
    assert len(done) == 1
