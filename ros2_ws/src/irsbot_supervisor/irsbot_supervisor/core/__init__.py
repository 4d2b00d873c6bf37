"""The decision core: samples in, verdicts out. No ROS, no clock, no I/O; one direction from sample to verdict.

`supervisor.Supervisor.step` runs validation, estimator, assessment, stopping prediction, policy and latch, in this
order.
"""

import irsbot_kinematics  # noqa: F401  selects compiled forms before the first module of this package is found
