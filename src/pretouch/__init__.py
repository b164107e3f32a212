"""Contact-anticipating control for robot arms with onboard proximity sensing."""

__version__ = "0.1.0"
