"""Robots as files: YAML descriptions, records in bags, shapes for URDF."""
