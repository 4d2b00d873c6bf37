"""From accepted samples to certain knowledge of the joints: position, bounds of the velocity, time until the next
sample.

`observer` bounds velocities from positions alone. Each kind of error beyond the stated ones has its own detector:
`jumps`, `frozen`, `clock_steps`, `publishers`. `estimator` runs them in order.
"""
