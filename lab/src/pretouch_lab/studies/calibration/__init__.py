"""The calibration of the skin in simulation, beside the method of the literature."""
