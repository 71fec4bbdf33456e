"""Entry point: ``slideviz`` and ``python -m slideviz``."""

from __future__ import annotations

import _thread
import atexit
import gc
import os
import signal
import sys

from slideviz import __version__
from slideviz.system.platform import ENDING_SIGNALS, wakeup_pipe


def main() -> int:
    """Run the command line and return its exit code; ``--version`` loads no heavy library."""
    _hold_streams()
    _heed_signals()
    # Loading libraries makes objects that stay: looking for garbage among them takes 0.05 s.
    gc.set_threshold(100_000)
    if sys.argv[1:] in (["--version"], ["-V"]):
        print(f"slideviz {__version__}")
        return 0
    # Late: `--version` needs no parser, which takes 0.1 s.
    from slideviz.cli import run

    return run(sys.argv[1:])


def _hold_streams() -> None:
    """Open standard streams that the caller closed (``>&-``), as the null device.

    Else the next file that is opened would take the place of such a stream.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115


def _heed_signals() -> None:
    """Start a thread that ends the process at an ending signal; ignored signals stay ignored.

    Python's own handlers raise an error in the main thread at any place: also in the middle of the
    import of VTK or Matplotlib, which crash then, or where a library swallows it. And they do not
    run while compiled code computes.
    """
    heeded = [number for number in ENDING_SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    _thread.start_new_thread(_wait, (wakeup_pipe(),))
    for number in heeded:
        signal.signal(number, lambda *_: None)
    # Functions registered first are called last: signals count until all others are done.
    atexit.register(_ignore, heeded)


def _ignore(numbers: list[signal.Signals]) -> None:
    """Ignore signals, while Python ends: else they could still kill a command that is done."""
    for number in numbers:
        signal.signal(number, signal.SIG_IGN)


def _wait(read: int) -> None:
    """Wait for a signal at the pipe ``read``, then clean up and end the process with a message."""
    number = 0
    while number not in ENDING_SIGNALS:
        number = os.read(read, 1)[0]
    try:
        # As long as this module is not loaded, there is nothing to clean up.
        cleanup = sys.modules.get("slideviz.system.cleanup")
        message = "it leaves nothing half-written"
        if cleanup is not None and hasattr(cleanup, "leftover_message"):  # it may be being loaded
            message = cleanup.leftover_message()
            cleanup.clean_up()
        wipe = "\r\033[K" if os.isatty(2) else ""  # there may be a progress bar
        words = f"{wipe}slideviz: {ENDING_SIGNALS[signal.Signals(number)]}; {message}\n"
        # Not by Python's streams, which another thread may have locked.
        os.write(2, words.encode())
    finally:
        os._exit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
