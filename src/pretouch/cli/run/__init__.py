"""What `pretouch run` does."""
