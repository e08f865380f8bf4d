"""Benchmarks: speed and error compared with whatever else can do the same."""
