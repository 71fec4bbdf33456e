"""``njit`` with a checked cache on disk, and the same machine code from it as from compiling.

Numba trusts its cache: an index that was cut off (by a full disk, a killed process) ends the
program, and so does damaged machine code. Here both begin with a checksum (SHA-256), which is
checked when they are read. Where the cache can be neither read nor written, functions are compiled
in each process.
"""

from __future__ import annotations

import hashlib
import io
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numba
from numba.core import environment, event
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.environment import Environment
from numba.core.runtime import rtsys


def _environment(module: str, constants: list, name: str) -> Environment:
    """Return the environment (globals and constants) of a compiled function, for unpickling it.

    It replaces Numba's `_rebuild_env`, which imports the module of the function. Modules of Numba
    are not imported here: that takes long, and loaded machine code does not use them.
    """
    if module.partition(".")[0] != "numba" or module in sys.modules:
        return environment._rebuild_env(module, constants, name)
    known = environment.lookup_environment(name)
    if known is None:
        known = Environment({"__name__": module})
        known.consts[:] = constants
        known.env_name = name
        Environment._memo[name] = known
    return known


class _Reader(pickle.Unpickler):
    """Unpickles machine code from the cache, with `_environment` for Numba's function."""

    def find_class(self, module: str, name: str) -> Any:
        """Return the object of that name, as pickle asks for it."""
        if (module, name) == (environment.__name__, "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


class _SealedFile(IndexDataCacheFile):  # type: ignore[misc]
    """Files of one function's cache: index and machine code, each behind its checksum.

    The methods replace those of Numba's class.
    """

    def _load_index(self) -> dict:
        """Return the cache's entries by argument types; empty if missing, damaged or outdated."""
        try:
            sealed = Path(self._index_path).read_bytes()
            version, stamp, overloads = pickle.loads(_without_checksum(sealed))
        except (OSError, ValueError):  # there is none yet, or it is damaged
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: dict) -> None:
        content = self._dump((self._version, self._source_stamp, overloads))
        with self._open_for_write(self._index_path) as file:
            file.write(_with_checksum(content))

    def _load_data(self, name: str) -> Any:
        """Return the machine code in the file ``name``; raise OSError if it is damaged."""
        try:
            content = _without_checksum(Path(self._data_path(name)).read_bytes())
            return _Reader(io.BytesIO(content)).load()
        except ValueError as problem:
            raise OSError(str(problem)) from problem  # Numba compiles it and writes it again

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as file:
            file.write(_with_checksum(self._dump(data)))


class _Cache(FunctionCache):  # type: ignore[misc]
    def __init__(self, function: Callable) -> None:
        super().__init__(function)
        self._cache_file = _SealedFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the machine code for argument types ``sig`` from the cache, or None.

        Numba's method first loads the declarations of all functions that it can compile, which
        takes a quarter of a second. Compiling loads them by itself, and machine code needs none.
        """
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save machine code for argument types ``sig``; nothing if it cannot be written."""
        with suppress(OSError):
            super().save_overload(sig, data)


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of one function, the same when it was just compiled as from the cache.

    Numba links copies of the loops that a function calls into it, and optimises them once more.
    A process that has just compiled would run the loops' first machine code, and one that loads
    the cache these copies, whose sums may differ in the last digits. As internal functions the
    copies are what runs in both.
    """

    def _finalize_final_module(self) -> None:
        if self._object_caching_enabled:
            for function in self._final_module.functions:
                if function.linkage.name in ("linkonce_odr", "weak_odr"):
                    function.linkage = "internal"
        super()._finalize_final_module()


JITCPUCodegen._library_class = _Library


OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Options of all compiled loops; division by zero gives inf or NaN."""


def njit(function: Callable | None = None, **options: Any) -> Any:
    """Decorate a function as Numba's ``njit`` with `OPTIONS`, and always with this module's cache.

    ``options``: others, in place of these or besides: ``@njit(parallel=True)``.
    """
    if function is None:
        return partial(njit, **options)
    dispatcher = numba.njit(**OPTIONS | options | {"cache": False})(function)
    dispatcher._cache = _Cache(function)
    return dispatcher


@contextmanager
def compilation_watched(compiling: Callable[[], None]) -> Iterator[None]:
    """Context that calls ``compiling`` when a loop is compiled, not loaded, in any thread."""

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: object) -> None:
            compiling()

        def on_end(self, _: object) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield


def _with_checksum(content: bytes) -> bytes:
    return hashlib.sha256(content).digest() + content


def _without_checksum(sealed: bytes) -> bytes:
    """Return the content that `_with_checksum` sealed, or raise ValueError."""
    content = sealed[32:]
    if hashlib.sha256(content).digest() != sealed[:32]:
        raise ValueError("the file is damaged")
    return content
