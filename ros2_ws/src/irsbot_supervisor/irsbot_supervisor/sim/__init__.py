"""What stands in for hardware: trajectories, drives, encoders and their faults. Pure: time is an argument."""
