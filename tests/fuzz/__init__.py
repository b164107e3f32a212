"""A seeded machine that drives the controller through anything, and what must hold after each step."""
