"""Benchmarks of one sample, batches, transport, high rates and start-up."""
