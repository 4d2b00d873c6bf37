"""Benchmarks of one sample, batches, transport and start-up."""
