"""Sweeps: any parameters of any experiment: a grid, a Latin hypercube, Sobol indices (docs/how-to/sweep.md)."""
