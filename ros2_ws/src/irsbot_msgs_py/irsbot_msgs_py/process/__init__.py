"""A node's process: start, run, exit deadline, transport."""
