"""What an arm's residual torques in free motion tell of it: offsets, friction, ripple, masses and noise."""
