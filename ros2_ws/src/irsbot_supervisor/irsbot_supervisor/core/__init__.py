"""The decision core: samples in, verdicts out. No ROS, no clock, no I/O; one direction from sample to verdict.

intake -> estimator -> assess -> stopping -> policy -> latch, in this order, by `pipeline.Supervisor.step`.
"""
