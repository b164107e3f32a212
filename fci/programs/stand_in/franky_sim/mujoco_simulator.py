"""The simulator that franky's tests ask for."""

from franky_sim import _Context


class Robot:
    """A robot of the simulator."""

    hostname = "127.0.0.1"


class MujocoSimulator(_Context):
    """What simulates."""

    def add_robot(self) -> Robot:
        """Give the robot of the server that runs."""
        return Robot()
