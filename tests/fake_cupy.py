"""An array module with CuPy's names over NumPy, whose card is the processor.

``card.cu`` is compiled by a C++ compiler: a block of threads is a team of OpenMP, and blocks
run one after the other. So the very source and the calls are tested without a card.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from slideviz.rbf import card
from slideviz.system import device

COMPILER = shutil.which("g++")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs g++")

TILE = 8  # threads of a block, as many as OpenMP starts here

AROUND = """
#include <cmath>
#include <omp.h>
using std::exp; using std::fmax; using std::log; using std::sqrt;
static int KIND, PERIODIC;
static thread_local struct { long long x; } blockIdx, threadIdx;
#define __device__
#define __global__
#define __shared__ static
static void __syncthreads()
{
#pragma omp barrier
}
%s
template <class Work> static void on_card(int kind, int periodic, long long blocks, Work work)
{
    KIND = kind;
    PERIODIC = periodic;
#pragma omp parallel num_threads(TILE)
    for (long long b = 0; b < blocks; ++b) {
        blockIdx.x = b;
        threadIdx.x = omp_get_thread_num();
        work();
#pragma omp barrier
    }
}
typedef const double *In;
extern "C" void run_add_up(int kind, int periodic, Count blocks, In x, In c, In w, Count count,
                           Count n, Count m, double period, double scale, double *out)
{
    on_card(kind, periodic, blocks, [=] { add_up(x, c, w, count, n, m, period, scale, out); });
}
extern "C" void run_fill_matrix(int kind, int periodic, Count blocks, In x, In c, In m, In l,
                                Count count, Count n, Count d, double period, double scale,
                                double *out)
{
    on_card(kind, periodic, blocks,
            [=] { fill_matrix(x, c, m, l, count, n, d, period, scale, out); });
}
"""


@cache
def library(code, options):
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "card.cpp"
        source.write_text(AROUND % code)
        built = source.with_suffix(".so")
        flags = ("-O1", "-w", "-fopenmp", "-shared", "-fPIC", *options)
        subprocess.run([COMPILER, *flags, source, "-o", built], check=True)
        return ctypes.CDLL(str(built))


class RawModule:
    """CuPy's class, for the functions of ``card.cu`` alone."""

    def __init__(self, *, code, options):
        self._values = dict(option.removeprefix("-D").split("=") for option in options)
        kept = tuple(o for o in options if not o.startswith(("-DKIND", "-DPERIODIC")))
        self._library = library(code, kept)

    def get_function(self, name):
        function = self._library[f"run_{name}"]
        first = [int(self._values["KIND"]), int(self._values["PERIODIC"])]

        def run(grid, block, arguments):
            assert block == (TILE,)
            kinds = {np.int64: ctypes.c_longlong, np.float64: ctypes.c_double}
            values = []
            for each in arguments:
                if isinstance(each, np.ndarray):
                    assert each.flags.c_contiguous
                    assert each.dtype == np.float64
                    values.append(ctypes.c_void_p(each.ctypes.data))
                else:
                    values.append(kinds[type(each)](each))
            function(*first, ctypes.c_longlong(grid[0]), *values)

        return run


def on_card(array):
    """A copy, as CuPy makes one: what is written to it does not reach the host."""
    return np.array(array)


def make(count=1, free=1 << 30):
    """Return the module, for ``count`` cards with so many bytes of free memory."""
    module = ModuleType("cupy")
    module.__spec__ = ModuleSpec("cupy", None)
    facts = {"name": b"Fake", "totalGlobalMem": 2 << 30}
    module.__dict__.update(
        array=np.array,
        asarray=on_card,
        asnumpy=lambda array, order="C": np.array(array, order=order),
        empty=np.empty,
        zeros=np.zeros,
        RawModule=RawModule,
        get_default_memory_pool=lambda: SimpleNamespace(free_bytes=lambda: 0),
        cuda=SimpleNamespace(
            runtime=SimpleNamespace(
                getDeviceCount=lambda: count,
                memGetInfo=lambda: (free, 2 * free),
                getDeviceProperties=lambda _: facts,
            )
        ),
    )
    return module


def forget():
    for kept in (device.card_arrays, device.why_no_card, card._kernel):
        kept.cache_clear()


@pytest.fixture
def fake_cupy(monkeypatch):
    """A function that puts such a module where ``import cupy`` finds it."""

    def put(**facts):
        module = make(**facts)
        linalg = SimpleNamespace(solve_triangular=solve_triangular)
        monkeypatch.setitem(sys.modules, "cupy", module)
        for name in ("cupyx", "cupyx.scipy"):
            monkeypatch.setitem(sys.modules, name, ModuleType(name))
        monkeypatch.setitem(sys.modules, "cupyx.scipy.linalg", linalg)
        monkeypatch.setattr(card, "TILE", TILE)
        forget()
        return module

    yield put
    monkeypatch.undo()
    forget()
