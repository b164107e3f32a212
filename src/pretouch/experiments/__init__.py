"""The paper's experiments in simulation: one file each, and what turns them into numbers, tables and figures."""
