"""Studies of what is not in the paper: mounting, wires, IMUs, touch sensors, cameras, clamping, coverage."""
