"""The simulated arm as a server of the Franka Control Interface."""
