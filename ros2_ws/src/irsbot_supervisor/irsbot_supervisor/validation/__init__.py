"""Fault campaigns and benchmarks."""
