"""The arm in a browser: a simulation to touch, or a recording."""
