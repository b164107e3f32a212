"""Experiments: each file has the cells, the trial, the measures, the tables and the figure of one question."""
