"""The command `pretouch skin calibrate`."""
