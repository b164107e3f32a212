"""A simulated Franka Panda or FR3 behind the Franka Control Interface, for any program that uses libfranka."""
