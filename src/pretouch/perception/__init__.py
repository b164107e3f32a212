"""From readings to obstacle points and the closest points of the body."""
