"""Measures of this repository."""
