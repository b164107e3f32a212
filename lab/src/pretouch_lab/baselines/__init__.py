"""Baselines of the benchmarks: parts of profiles by entry points, and profiles."""
