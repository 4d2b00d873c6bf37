"""Equations as machine code.

`symbols` records the operations of equations, `source` writes those of a mechanism as C for `evaluate_many`, `library`
has them compiled and calls them. `branching` also records comparisons, `box_source` writes the certified bounds over
boxes as C, and `python -m irsbot_kinematics.machine_code` has them compiled. Nothing is derived a second time.
"""
