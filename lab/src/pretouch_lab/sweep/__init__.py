"""Sweeps: any parameters of an experiment, over a grid or for Sobol indices (docs/how-to/sweep.md)."""
