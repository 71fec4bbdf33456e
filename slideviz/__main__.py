"""Entry point: ``slideviz`` and ``python -m slideviz``."""

from __future__ import annotations

import _thread
import atexit
import os
import signal
import sys

_ENDS = {
    signal.SIGINT: "cancelled",
    signal.SIGTERM: "ended by SIGTERM",
}
"""The signals that end any command at any moment: code 128 and the number of the signal."""
if hasattr(signal, "SIGHUP"):  # Windows has none
    _ENDS[signal.SIGHUP] = "ended by SIGHUP"


def main() -> int:
    """Run the command line and return its exit code; ``--version`` loads nothing heavy."""
    _hold_streams()
    _heed_signals()
    if sys.argv[1:] in (["--version"], ["-V"]):
        from slideviz import __version__

        print(f"slideviz {__version__}")
        return 0
    from slideviz.cli import run

    return run(sys.argv[1:])


def _hold_streams() -> None:
    """Open what the caller closed (``>&-``); else the next file that is opened would be it."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115


def _heed_signals() -> None:
    """Let a thread wait for the signals that end a command; those that are ignored stay so.

    Python would raise an error wherever it is: in the middle of an import of VTK or Matplotlib,
    which then crash, or where a library swallows it; and not at all while one computes.
    """
    heeded = [number for number in _ENDS if signal.getsignal(number) != signal.SIG_IGN]
    read, write = os.pipe()
    os.set_blocking(write, False)
    _thread.start_new_thread(_wait, (read,))
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    for number in heeded:
        signal.signal(number, lambda *_: None)
    # Of all that is done at the end this comes last, as nothing was registered before.
    atexit.register(_ignore, heeded)


def _ignore(numbers: list[signal.Signals]) -> None:
    """Ignore signals while Python ends: it would let them kill a command that is done."""
    for number in numbers:
        signal.signal(number, signal.SIG_IGN)


def _wait(read: int) -> None:
    """End the process when a signal comes."""
    number = 0
    while number not in _ENDS:
        number = os.read(read, 1)[0]
    try:
        # Nothing is to be cleaned up as long as this is not loaded.
        cleanup, left = sys.modules.get("slideviz.mesh.io.cleanup"), "nothing half-written is left"
        if cleanup is not None and hasattr(cleanup, "left"):  # it may be being loaded
            left = cleanup.left()
            cleanup.clean_up()
        wipe = "\r\033[K" if os.isatty(2) else ""  # there may be a progress bar
        words = f"{wipe}slideviz: {_ENDS[signal.Signals(number)]}; {left}\n"
        # Past Python's streams, which another thread may hold.
        os.write(2, words.encode())
    finally:
        os._exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
