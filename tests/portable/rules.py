"""Rules of Windows for `slideviz`, as far as they can be made on another system.

* What `slideviz.system.platform` uses of POSIX is not there: its modules are replaced by others
  that lack those names.
* A file that is open in this process, or mapped, can be neither removed nor replaced.
* Text files get lines that end with CRLF, unless it is said otherwise.
* Names of files count without upper and lower case where paths are compared.
* Files that are opened by their descriptor are text, unless ``O_BINARY`` is said.
* No process is forked.

Other systems' calls remain to Python and its libraries: only slideviz is tested.
"""

from __future__ import annotations

import builtins
import importlib.abc
import importlib.machinery
import os
import pathlib
import signal
import sys
from types import ModuleType, SimpleNamespace

PLATFORM = "slideviz.system.platform"
LACKING = {
    "os": (
        "O_NOFOLLOW O_DSYNC pread pwrite copy_file_range posix_fallocate fchmod sched_getaffinity "
        "sched_setaffinity getpriority setpriority sysconf set_blocking fork uname getuid"
    ),
    "signal": "SIGHUP SIGXCPU SIGKILL pthread_sigmask sigwait SIGALRM setitimer",
    "mmap": "MADV_DONTNEED",
    "socket": "AF_UNIX",
}
"""Names that Windows lacks, by module."""
MISSING = ("resource", "fcntl", "pwd", "grp", "termios")
"""Modules that Windows lacks."""
O_BINARY = 1 << 30
"""Windows' flag for files without changed line ends, of another number here."""
O_TEMPORARY = 1 << 29
"""Windows' flag for files that are removed when they are closed, of another number here."""


class Lacking(ModuleType):
    """A module without some of its names, and with some others."""

    def __init__(self, module: ModuleType, lacking: str, **others: object) -> None:
        super().__init__(module.__name__)
        self.__dict__.update(
            {name: each for name, each in vars(module).items() if name not in lacking.split()}
        )
        self.__dict__.update(others)


class _Loader(importlib.abc.Loader):
    """Loads `slideviz.system.platform` with the modules that Windows has."""

    def __init__(self, loader: importlib.machinery.SourceFileLoader) -> None:
        self.loader = loader

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        before = {
            name: sys.modules.get(name) for name in (*LACKING, *MISSING, "ctypes", "platform")
        }
        others = {name: __import__(name) for name in (*LACKING, "ctypes", "platform")}
        try:
            for name, lacking in LACKING.items():
                sys.modules[name] = Lacking(others[name], lacking, **OTHERWISE.get(name, {}))
            sys.modules.update(dict.fromkeys(MISSING))  # type: ignore[arg-type]
            sys.modules["ctypes"] = Lacking(
                others["ctypes"], "", CDLL=_no_library, windll=SimpleNamespace(kernel32=_Kernel())
            )
            sys.modules["platform"] = Lacking(others["platform"], "", system=lambda: "Windows")
            self.loader.exec_module(module)
        finally:
            for name, each in before.items():
                if each is None:
                    sys.modules.pop(name, None)
                else:
                    sys.modules[name] = each
        module.open = _no_proc  # type: ignore[attr-defined]


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, path: object, target: object = None) -> object:
        if name != PLATFORM:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)  # type: ignore[arg-type]
        assert spec is not None
        spec.loader = _Loader(spec.loader)  # type: ignore[arg-type]
        return spec


class _Kernel:
    """What `slideviz` uses of Windows' kernel32."""

    def OpenProcess(  # noqa: N802
        self, _access: int, _inherit: bool, pid: int
    ) -> int:
        return pid if pid > 0 and os.path.exists(f"/proc/{pid}/stat") else 0  # noqa: PTH110

    def GetExitCodeProcess(  # noqa: N802
        self, _process: int, code: object
    ) -> int:
        code._obj.value = 259  # type: ignore[attr-defined]
        return 1

    def CloseHandle(  # noqa: N802
        self, _process: int
    ) -> int:
        return 1


def _no_library(name: object, *_: object) -> object:
    if name is None:
        raise TypeError("LoadLibrary() argument 1 must be str, not None")
    raise FileNotFoundError(f"Could not find module {name!r}")


def _no_proc(path: object, *more: object, **named: object) -> object:
    if str(path).startswith("/proc"):
        raise FileNotFoundError(2, "No such file", str(path))
    return builtins.open(path, *more, **named)  # type: ignore[call-overload]  # noqa: PTH123


def _open(path: str, flags: int, mode: int = 0o777) -> int:
    if not flags & O_BINARY:
        raise AssertionError(f"{path} is opened as text: its bytes would be changed")
    file = _REAL["open"](path, flags & ~(O_BINARY | O_TEMPORARY), mode)  # type: ignore[operator]
    if flags & O_TEMPORARY:
        _REAL["unlink"](path)  # type: ignore[operator]
    return file


def _set_wakeup_fd(file: int, **named: bool) -> int:
    """Windows asks no pipe whether it blocks."""
    os.set_blocking(file, False)
    return signal.set_wakeup_fd(file, **named)


OTHERWISE: dict[str, dict[str, object]] = {
    "os": {"name": "nt", "O_BINARY": O_BINARY, "O_TEMPORARY": O_TEMPORARY, "open": _open},
    "signal": {"set_wakeup_fd": _set_wakeup_fd},
}
"""What Windows has under another meaning, by module."""
_REAL: dict[str, object] = {
    "open": os.open,
    **{
        name: getattr(os, name)
        for name in ("replace", "rename", "unlink", "remove", "normcase")
        if hasattr(os, name)
    },
}


def _by_slideviz() -> bool:
    """Return whether the call comes from slideviz, not from a test or a library of its own."""
    frame = sys._getframe(2)
    here = os.path.dirname(os.__file__)  # noqa: PTH120
    while frame is not None:
        file = frame.f_code.co_filename
        if not file.startswith((here, "<")) or "site-packages" in file:
            return "/slideviz/" in file.replace("\\", "/") and "/tests/" not in file
        frame = frame.f_back
    return False


def is_open(path: object) -> bool:
    """Return whether this process has a file open, or mapped."""
    real = os.path.realpath(os.fspath(path))  # type: ignore[call-overload]
    for entry in os.listdir("/proc/self/fd"):  # noqa: PTH208
        try:
            if os.readlink(f"/proc/self/fd/{entry}") == real:  # noqa: PTH115
                return True
        except OSError:
            continue
    with builtins.open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:  # noqa: PTH123
        return any(line.rstrip("\n").endswith(f" {real}") for line in maps)


def _guarded(name: str) -> object:
    real = _REAL[name]

    def call(*paths: object, **named: object) -> object:
        for path in paths[:2]:
            if isinstance(path, int) or named.get("dir_fd") is not None:
                continue
            if _by_slideviz() and is_open(path):
                problem = PermissionError(13, "it is being used by another process", str(path))
                problem.winerror = 32  # type: ignore[attr-defined]
                raise problem
        return real(*paths, **named)  # type: ignore[operator]

    return call


def _write_text(
    self: pathlib.Path,
    data: str,
    encoding: str | None = None,
    errors: str | None = None,
    newline: str | None = None,
) -> int:
    with self.open("w", encoding=encoding, errors=errors, newline=newline or "\r\n") as file:
        return file.write(data)


def install() -> None:
    """Let the rules hold in this process, and in those that it starts."""
    sys.meta_path.insert(0, _Finder())  # type: ignore[arg-type]
    for name in ("replace", "rename", "unlink", "remove"):
        setattr(os, name, _guarded(name))
    pathlib.Path.write_text = _write_text  # type: ignore[method-assign]
    os.path.normcase = lambda path: os.fspath(path).lower()  # type: ignore[assignment]
    folder = os.path.dirname(__file__)  # noqa: PTH120
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if folder not in paths:
        os.environ["PYTHONPATH"] = os.pathsep.join([folder, *filter(None, paths)])
