"""The command `pretouch serve-fci`: its docstrings are the help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class ServeFci:
    """Serve a simulated Panda or FR3 to programs that use the vendor's library, as the robot itself would be."""

    robot: Literal["panda", "fr3"] = "panda"
    """The robot: panda speaks protocol 5 (libfranka 0.9), fr3 protocol 10 (libfranka 0.18 and later)."""
    host: str = "127.0.0.1"
    """Address to serve at. Anyone who can reach it can move the simulated arm."""
    port: int = 1337
    """TCP port; the vendor's library supports no other. The gripper has the next. 0 lets the system choose both."""
    lockstep: bool = False
    """Send each state only after the command for the last one: repeatable, and faster than real time."""
    patience: float = 60.0
    """In lockstep, a command that has not arrived after this time is lost [s]."""
    grace: float = 0.01
    """In real time, extra time beyond its millisecond to wait for a command [s]: this machine may be slow. 0 is as
    strict as the robot."""
    scene: Literal["empty", "static", "dynamic"] | Path = "empty"
    """Surroundings: nothing, the board of the static experiment, the person of the dynamic one, or a world of your own
    from an MJCF file, in which the arm stands at the site `base`, or else at the origin."""
    trajectory: Literal["circle", "line"] = "circle"
    """Path of the static experiment, beside which its board stands."""
    side: Literal["+y", "-y"] = "+y"
    """Side of the board."""
    stiffness: float = 25_000.0
    """Contact stiffness of board and boxes [N/m], greater than 0."""
    box: tuple[str, ...] = ()
    """Boxes in the empty scene, each X,Y,Z:DX,DY,DZ: centre and edges [m], base frame."""
    start: str = "ready"
    """Initial posture of the arm: ready, its usual one, path, that at the start of the path, or seven joint angles
    between commas [rad]."""
    seed: int = 0
    """Seed of the simulated arm and scene: each arm has different errors and noise, each scene different positions."""
    push: tuple[str, ...] = ()
    """Forces on the arm at its TCP, each T:FX,FY,FZ or T:FX,FY,FZ:DURATION [s, N, s], base frame, up to
    1000 N. T counts from the start of the server; in lockstep, from the first motion on, while the arm moves."""
    hand: bool = False
    """Let a person's hand come and go before the arm, in the empty scene."""
    object: str = ""
    """What lies between the fingers of the gripper, WIDTH:KG, such as 0.04:0.5 [m, kg]; by default nothing."""
    units: str = ""
    """HOST:PORT of the receiver of the arm's sensor units; by default they are switched off."""
    keys: str = ""
    """File of the keys of the units, the same as the receiver's."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    stdin: bool = False
    """Take what a person would type, such as 0.5:0,15,0:0.2 (0.5 s from now), from the standard input though it is no
    terminal, and end with it."""
    truth: str = ""
    """CSV file for the ground truth: true force on the arm and joint positions, each millisecond."""
    drop: str = ""
    """Commands to lose, such as 3/50: the first 3 of every 50."""
    once: bool = False
    """End when the first client has disconnected."""

    def run(self) -> None:
        """Serve until interrupted."""
        from pretouch_fci.serve import serve_fci

        serve_fci(self)
