"""Sections of a report, each from the measures of one recording."""
