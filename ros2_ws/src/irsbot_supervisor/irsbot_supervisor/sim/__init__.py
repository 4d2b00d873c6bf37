"""Simulation in place of hardware: trajectories, drives, encoders and their faults. Pure: time is an argument."""
