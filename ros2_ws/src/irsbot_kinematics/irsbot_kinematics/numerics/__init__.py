"""Arithmetic on floats and arrays, tolerances, roots of assembly equations."""
