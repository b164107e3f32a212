"""Runs kept as MCAP files, and what can be done with them: read, recompute, compare."""
