"""What `pretouch skin calibrate` does."""
