"""What can be said on the command line of `pretouch serve-fci`."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class ServeFci:
    """Serve a simulated Panda or FR3 to programs that use the vendor's library, as the robot itself would be."""

    robot: Literal["panda", "fr3"] = "panda"
    """The robot: panda speaks protocol 5 (libfranka 0.9), fr3 protocol 10 (libfranka 0.18 and later)."""
    host: str = "127.0.0.1"
    """Address to serve at. Anyone who can reach it can move the simulated arm."""
    port: int = 1337
    """TCP port; the vendor's library knows no other. 0 lets the system choose one."""
    lockstep: bool = False
    """The next state follows the command for the last one: repeatable, and faster than real time."""
    patience: float = 60.0
    """In lockstep, a command that has not come after this time is lost [s]."""
    grace: float = 0.01
    """In real time, how much longer than its millisecond a command is waited for [s]: this machine may be slow. 0 is as
    strict as the robot."""
    scene: Literal["empty", "static", "dynamic"] = "empty"
    """What is there: nothing, the board of the static experiment, or the person of the dynamic one."""
    trajectory: Literal["circle", "line"] = "circle"
    """Path of the static experiment, which its board stands beside."""
    side: Literal["+y", "-y"] = "+y"
    """Side of the board."""
    stiffness: float = 25_000.0
    """Contact stiffness of the board [N/m], greater than 0."""
    start: Literal["ready", "path"] = "ready"
    """Where the arm stands at first: its usual posture, or the start of the path."""
    seed: int = 0
    """Simulated arm to take: each has other errors and noise, and the scene other places."""
    push: tuple[str, ...] = ()
    """Forces on the arm at its TCP, each T:FX,FY,FZ or T:FX,FY,FZ:DURATION [s, N, s], base frame, up to
    1000 N. T counts from the start of the server; in lockstep, from the first motion on, while the arm moves."""
    hand: bool = False
    """Let a person's hand come and go before the arm, in the empty scene."""
    units: str = ""
    """HOST:PORT of the receiver of the arm's sensor units; by default they are switched off."""
    keys: str = ""
    """File of the keys of the units; the receiver has the same."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    truth: str = ""
    """CSV file for what the client is not told: true force on the arm and joint positions, each millisecond."""
    drop: str = ""
    """Commands to lose, as 3/50: the first 3 of every 50."""
    once: bool = False
    """End when the first client has gone."""

    def run(self) -> None:
        """Serve until interrupted."""
        from pretouch.cli.serve_fci import serve_fci

        serve_fci(self)
