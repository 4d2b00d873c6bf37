"""Commands that pass the supervisor: velocities, trajectories, the hold."""
