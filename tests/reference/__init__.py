"""The control step once more, in plain NumPy and written to be read: what the fast one is held against."""
