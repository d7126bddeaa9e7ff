"""Farms for benchmarks, with real workers and simulated ones."""
