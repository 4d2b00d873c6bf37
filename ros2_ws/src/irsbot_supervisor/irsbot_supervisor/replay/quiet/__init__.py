"""Stretches of a recording in which no verdict can change, judged as columns.

`motion` computes what the estimator computes for each sample, bit for bit; `postures` the margins with the rounding of
numpy, so a sample near a limit is left to the supervisor; `handover` reads and writes the supervisor's state at the
ends of a stretch; `strides` decides which samples are judged as columns.
"""
