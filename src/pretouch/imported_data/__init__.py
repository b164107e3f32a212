"""Recordings of other programs, and what our thresholds make of them."""
