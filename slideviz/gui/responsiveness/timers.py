"""Single-shot timers, and the constants that keep the window responsive, each with its reason.

Nowhere else in ``gui/`` are threads, priorities, garbage collection or waiting times set; a test
checks that. Related: `slideviz.session.pieces.PART_CELLS` (cells drawn in one piece), and
`slideviz.rbf`, which compiles its loops with ``nogil`` and does small work in one thread.
"""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import QObject, QTimer

# Interpreter, threads and garbage ----------------------------------------------------------
SWITCH_S = 0.00005
"""How long a thread may keep the interpreter (GIL) when another one waits for it, in seconds.

Drawing a frame takes the interpreter a hundred times: at Python's default of 5 ms each, or even at
1 ms, the view would stutter while another thread draws a plot.
"""
NICENESS = 5
"""How much the nice value of a job's thread is above that of the GUI thread.

Not more: the window waits for a job that holds the interpreter, and beside other busy programs the
job would hardly advance.
"""
NUMPY_THREADS = 1
"""Number of threads of NumPy's BLAS, if SciPy, which solves the large systems, has its own.

The GUI thread multiplies matrices, too; on a busy machine the threads of BLAS wait for each other:
0.14 s instead of 3 ms for the points of a large mesh.
"""
GARBAGE_MS = 200
"""Least time between two garbage collections, as one blocks the window for some ms."""

GARBAGE_OBJECTS = 2000
"""Least number of objects made since the last garbage collection for another one."""

GARBAGE_REST_TIMES = 20
"""Least time between two garbage collections, relative to the last one's duration: 5 % at most."""

WARM_UP_MS = 300
"""Delay from showing the window to compiling the numerics, which would slow down its drawing."""

CLOSING_S = 1.0
"""How long a closing window waits for its job's thread, which a library may keep for minutes."""

# Painting ----------------------------------------------------------------------------------
REPAINT_MS = 1
"""Delay from a change to the view's repaint.

Not 0: the repaint would wait for all other timers that are due, such as the player's.
"""

TURN_MS = 1
"""Delay between two pieces of work; not 0, so that other timers and clicks are handled between."""

TICK_MS = 33
"""Shortest interval of the player's timer: 30 frames per second look smooth.

If drawing takes longer, steps are skipped.
"""

SLOW_FRAME_S = 0.04
"""Drawing time of a frame above which boundaries are drawn coarse while the mouse moves something.

Two frames of that time in a row are felt as a delay."""

STILL_MS = 250
"""Time without a mouse movement after which the boundaries are drawn in full detail again."""

NEWS_S = 0.1
"""Least time between two progress reports of a job, as each one repaints the whole window."""

COUNTING_MS = 300
"""Delay from a repeated error to showing its count, as each one repaints the whole window."""

# Plots and tables --------------------------------------------------------------------------
REST_MS = 200
"""Least time between two drawings of a plot or table while steps are played."""

REST_TIMES = 4.0
"""Pause of a plot after a drawing, relative to the time that the drawing took."""

MOST_REST = 4
"""Longest pause of a plot after a drawing, in units of `REST_MS`."""

LOOK_MS = 8
"""Interval at which a finished plot is polled for: half the time of a screen's frame."""

# After what the user does ------------------------------------------------------------------
SELECTING_MS = 120
"""Delay from a drag in the histogram to selecting the cells: not once per mouse event."""

PREVIEW_MS = 120
"""Delay from the last change of an option to drawing the preview of a picture or film."""

TABLE_MS = 150
"""Delay from the last key to checking a table of displacements, which takes a while if long."""

ROWS_MS = 250
"""Delay from the first new result of a design to showing all results that came until then."""

INTERSECTION_MS = 200
"""Delay from the last change of the case to the job that checks boundaries for intersections."""

FIELDS_MS = 1000
"""Delay from the last change of the case to making the fields of previews, which takes a second."""

HAND_MS = 500
"""Delay from the last movement of the hand to the run that replaces the preview."""

AUTOSAVE_MS = 5000
"""Delay from the first unsaved change to writing the session."""

READ_MS = 100
"""Interval at which a run that was asked for at the start checks whether its file is read."""


def single_shot(parent: QObject | None, call: Callable[[], object], wait_ms: int = 0) -> QTimer:
    """Return a single-shot timer that calls ``call``, ``wait_ms`` after it was last started.

    At 0 ms it calls in the next turn of the event loop, once for all starts in this one.
    """
    timer = QTimer(parent, singleShot=True, interval=wait_ms)
    timer.timeout.connect(call)
    return timer
