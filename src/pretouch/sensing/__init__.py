"""Sensor units: what one is, where each sits on the arm, and the file that says so."""
