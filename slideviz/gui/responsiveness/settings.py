"""Every number that keeps the window answering: setting, value, reason.

Nowhere else in ``gui/`` is there a thread, a priority, garbage, or a time to wait; a test holds the
rest against that. Besides: `slideviz.session.pieces.PART_CELLS` (faces drawn in one piece), and
`slideviz.rbf` compiles its loops with ``nogil`` and does small work in one thread.
"""

# Interpreter, threads and garbage ----------------------------------------------------------

SWITCH_S = 0.00005
"""How long a thread may keep the interpreter to itself when another wants it.

A picture asks for the interpreter a hundred times: at Python's 5 ms each, or even at one, that
would be seen while another thread draws a plot.
"""
NICENESS = 5
"""How far a job stands back behind the window where both want the processor.

Not further: while it keeps the interpreter, the window waits for it, and where other programs are
busy, too, it would hardly go on.
"""
NUMPY_THREADS = 1
"""Of NumPy's BLAS, where SciPy, which solves the large systems, has one of its own.

The window multiplies, too, and on a busy machine the threads of BLAS wait for each other: 0.14 s
instead of 3 ms for the points of a large mesh.
"""
GARBAGE_MS = 200
"""Between two looks for garbage, at least: a look stops the window for some ms."""
GARBAGE_OBJECTS = 2000
"""Objects made since the last look that are worth another one."""
GARBAGE_REST_TIMES = 20
"""The next look is not before so many times as long as one took: it takes 5 % at most."""
WARM_UP_MS = 300
"""Before the numerics are compiled: the window is drawn first, which that slows down a little."""
CLOSING_S = 1.0
"""How long a window that closes waits for its job; a library may keep its thread for minutes."""

# Painting ----------------------------------------------------------------------------------

REPAINT_MS = 1
"""Until a changed view is painted.

Not 0: that would wait for every other timer that is due, one that plays for example.
"""
TURN_MS = 1
"""Between two pieces of work; not 0, so that other timers and clicks come between them."""
TICK_MS = 33
"""Shortest time between two steps that are played: 30 pictures in a second look smooth.

Where drawing takes longer, too, steps are left out.
"""
SLOW_FRAME_S = 0.04
"""A picture that takes longer is drawn with fewer facets while the mouse moves the camera.

Two such in a row, and what Qt does with them, are felt."""
STILL_MS = 250
"""A camera that the mouse has not moved for so long is at rest, and everything is drawn again."""
NEWS_S = 0.1
"""Between two news of a job, at least: each time the whole window goes to the screen again."""
COUNTING_MS = 300
"""Between two counts of an error that comes again and again, for the same reason."""

# Plots and tables --------------------------------------------------------------------------

REST_MS = 200
"""Between two drawings of a plot or table while steps are played, at least."""
REST_TIMES, MOST_REST = 4.0, 4
"""A plot rests so many times as long as its drawing took, but not more than so many ``REST_MS``."""
LOOK_MS = 8
"""How often it is looked whether a plot is there: unseen at half a picture's time."""

# After what the user does ------------------------------------------------------------------

SELECTING_MS = 120
"""Cells are selected in a histogram while the mouse moves, but not with each of its pixels."""
PREVIEW_MS = 120
"""The preview of a picture or film waits for the end of what is typed."""
TABLE_MS = 150
"""A table of motions is checked so long after the last key: a long one takes a while."""
ROWS_MS = 250
"""Results of designs are shown so long after the first of them came, all together."""
INTERSECTION_MS = 200
"""Boundaries are checked for intersections so long after the last change: it takes a job."""
AUTOSAVE_MS = 5000
"""The session is written so long after the first change that is not in the file yet."""
READ_MS = 100
"""How often a run that waits for its file looks whether that is read."""
