"""Threads, timers, garbage collection and repaints of the window."""
