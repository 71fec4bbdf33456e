"""What the program asks of the system: whole files, clean-up, threads, ranks, compiled loops."""
