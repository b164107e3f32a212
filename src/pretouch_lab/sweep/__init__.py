"""Sweeps: any parameters of any experiment: a grid, a Latin hypercube, Sobol indices (docs/sensitivity.md)."""
