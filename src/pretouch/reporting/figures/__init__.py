"""Figures of a report, drawn from the course of a recording."""
