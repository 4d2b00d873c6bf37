"""From accepted samples to what is certain of the joints: position, bounds of the velocity, time until the next sample.

`observer` bounds velocities from positions alone. Every way in which a message can be wrong beyond the stated errors
has a detector of its own: `jumps`, `frozen`, `clock_steps`, `publishers`. `estimator` puts them in order.
"""
