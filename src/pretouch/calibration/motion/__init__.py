"""The motion by which units are calibrated: chosen, kept within limits, and made."""
