"""The simulated skin on a real wire."""
