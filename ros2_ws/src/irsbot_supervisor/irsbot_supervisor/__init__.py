"""Singularity supervision of parallel robots: decision core, simulated joints, tape, replay, nodes, command line."""
