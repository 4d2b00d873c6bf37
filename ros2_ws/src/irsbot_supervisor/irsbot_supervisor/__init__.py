"""Singularity supervision of parallel robots: decision core, simulated joints, tape, replay, nodes, command line."""

__version__ = "0.1.0"
