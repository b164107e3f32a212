"""In place of franky-sim, for franky's own tests: the server that already runs is the simulator they ask for."""

from typing import Self


class _Context:
    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return


class SimulationServer(_Context):
    """What serves a simulator."""

    def __init__(self, simulator: object) -> None:
        """Take the simulator that would be served."""

    def run_async(self) -> None:
        """Do nothing: it runs."""
