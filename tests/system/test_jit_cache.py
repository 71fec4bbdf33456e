"""A damaged cache of compiled code is compiled again, and harms nobody."""

import inspect
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import environment, event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

from slideviz.system.jit_cache import njit


def double(x):
    return x * 2.0


def half(x):
    return x / 2.0


class Compiled(event.Listener):
    """Counts what is compiled."""

    def __init__(self):
        self.count = 0

    def on_start(self, _):
        self.count += 1

    def on_end(self, _):
        pass


def compilations(function=double) -> int:
    """Return how many functions were compiled for a call."""
    listener = Compiled()
    with event.install_listener("numba:compile", listener):
        assert njit(cache=True)(function)(3.0) == function(3.0)
    return listener.count


PRIVATE = {
    IndexDataCacheFile: {
        "__init__": "self cache_path filename_base source_stamp",
        "_load_index": "self",
        "_save_index": "self overloads",
        "_load_data": "self name",
        "_save_data": "self name data",
        "_data_path": "self name",
        "_dump": "self obj",
        "_open_for_write": "self filepath",
    },
    FunctionCache: {
        "__init__": "self py_func",
        "load_overload": "self sig target_context",
        "save_overload": "self sig data",
        "_load_overload": "self sig target_context",
        "_guard_against_spurious_io_errors": "self",
    },
    JITCodeLibrary: {"_finalize_final_module": "self"},
    environment: {
        "_rebuild_env": "modname consts env_name",
        "lookup_environment": "env_name",
    },
}
"""Private parts of Numba that `slideviz.system.jit_cache` replaces or calls: their parameters."""


def test_numba_has_the_private_parts_that_the_cache_replaces():
    remedy = "adapt system/jit_cache.py, then the range of numba in pyproject.toml"
    for owner, parts in PRIVATE.items():
        for name, wanted in parts.items():
            there = getattr(owner, name, None)
            has = there and " ".join(inspect.signature(there).parameters)
            what = f"{owner.__name__}.{name}({has}), not ({wanted})"
            assert has == wanted, f"Numba {numba.__version__} has {what}: {remedy}"
    made = FunctionCache(half)
    parts = [made._cache_path, made._impl.filename_base, made._impl.locator.get_source_stamp()]
    file = IndexDataCacheFile(*parts)
    assert all(hasattr(file, name) for name in ("_index_path", "_version", "_source_stamp")), remedy
    assert hasattr(made, "_cache_file"), remedy
    assert hasattr(numba.njit(half), "_cache"), remedy
    assert isinstance(environment.Environment._memo, Mapping), remedy
    assert issubclass(JITCPUCodegen._library_class, JITCodeLibrary), remedy


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    """The folder of a cache with one function in it."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    assert compilations() == 1
    assert compilations() == 0
    (index,) = tmp_path.rglob("*.nbi")
    return index.parent


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def garbage(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(2000))


def one_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) * 2 // 3] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [cut, one_bit])
@pytest.mark.parametrize("kind", ["*.nbi", "*.nbc"])
def test_what_is_damaged_is_compiled_again_once(cache, kind, damage):
    (path,) = cache.glob(kind)
    damage(path)
    assert compilations() == 1
    assert compilations() == 0


def test_what_is_missing_is_compiled_again(cache):
    (path,) = cache.glob("*.nbc")
    path.unlink()
    assert compilations() == 1
    assert compilations() == 0


def test_a_cache_that_cannot_be_written_only_costs_time(cache, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("slideviz.system.jit_cache._SealedFile._open_for_write", full)
    assert compilations(half) == 1
    assert compilations(half) == 1


def test_all_loops_have_this_cache():
    """None is compiled by Numba's own decorator."""
    root = Path(sys.modules["slideviz"].__file__).parent
    users = [path.name for path in root.rglob("*.py") if "njit" in path.read_text()]
    own = [
        path.name
        for path in root.rglob("*.py")
        if re.search(r"system.jit_cache import (OPTIONS, )?njit", path.read_text())
    ]
    assert sorted(users) == sorted([*own, "jit_cache.py"])


SUM_OF_THREE_FEATURES = """
import numpy as np
from slideviz.rbf.compiled import sum_plain

random = np.random.default_rng(0)
out = np.empty((3, 2000))
sum_plain(random.random((3, 2000)), random.random((3, 333)), random.random((3, 333)), 0.0, 0.8, out)
print(out.tobytes().hex())
"""


def test_the_cache_gives_the_bits_of_a_loop_just_compiled(tmp_path):
    """Of a parallel sum, whose order the compiler may choose."""
    places = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    call = [sys.executable, "-c", SUM_OF_THREE_FEATURES]
    compiled, loaded = (
        subprocess.run(call, env=places, check=True, capture_output=True).stdout for _ in range(2)
    )
    assert loaded == compiled


@pytest.mark.slow
def test_a_run_survives_a_damaged_cache(tmp_path):
    places = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def slideviz(*words: str) -> None:
        call = [sys.executable, "-m", "slideviz", *words]
        subprocess.run(call, cwd=tmp_path, env=places, check=True)

    slideviz("sample", "square", "-o", ".")
    slideviz("run", "square.cfg", "--set", "STEPS=1")
    for path in (tmp_path / "cache").rglob("*.nb*"):
        garbage(path)
    slideviz("run", "square.cfg", "--set", "STEPS=1")
