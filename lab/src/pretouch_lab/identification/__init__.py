"""Identification of an arm from its residual torques in free motion: offsets, friction, ripple, masses and noise."""
