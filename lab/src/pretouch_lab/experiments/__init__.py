"""Experiments: one question, one file, which says what is played, what is measured, its tables and its figure."""
