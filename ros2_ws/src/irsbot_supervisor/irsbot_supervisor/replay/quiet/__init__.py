"""Stretches of a recording in which no verdict can change, judged as columns.

`motion` computes what the estimator computes for each sample, bit for bit, with the filters of `filters`, and asks
`suspicion` where an encoder may be frozen; `postures` has the margins with the rounding of numpy, so a sample near a
limit is left to the supervisor; `boxes` follows the boxes of the stopping predictor; `handover` reads and writes the
supervisor's state at the ends of a stretch; `strides` decides which samples are judged as columns.
"""
