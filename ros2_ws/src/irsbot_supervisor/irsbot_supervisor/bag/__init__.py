"""Recorded runs: MCAP files, the journal of the supervisor, the black box, columns."""
