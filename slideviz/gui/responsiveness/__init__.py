"""What steers threads, timers, garbage and repaints of the window."""
