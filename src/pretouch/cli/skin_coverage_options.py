"""What can be said after `pretouch skin coverage`; its docstrings are the help."""

from dataclasses import dataclass

import tyro


@dataclass(frozen=True)
class Coverage:
    """What share of all that could come at the arm a skin sees in time, link by link; blind spots; better places."""

    skin: tyro.conf.Positional[str] = ""
    """Skin file; by default the seven units that come with the package, or the skin in the arm's folder."""
    arm: str = "panda"
    """panda, fr3, or the folder of an arm that `pretouch robot import` wrote."""
    workspace: str = "paths"
    """Postures to average over: circle, line, paths (both of the paper's), joints (their whole range), or opposite
    corners x,y,z,x,y,z of a box of hand positions [m]."""
    speed: float = 0.5
    """Speed of what comes [m/s]."""
    arm_speed: float = 0.3
    """Speed at which the arm moves towards it [m/s]."""
    deceleration: float = 0.6
    """Deceleration with which the arm brakes [m/s^2]."""
    object_radius: float = 0.05
    """Radius of what comes [m]: a fist by default."""
    rate: float = 50.0
    """Readings of a unit a second [Hz]."""
    latency: float = 0.04
    """Time from a measurement to a motion [s]."""
    range: float = 1.3
    """Farthest target that fills a unit's cone [m]."""
    reflectance: float = 0.5
    """Of what comes, at 940 nm."""
    way: float = 0.8
    """Length of the straight way on which it comes [m]."""
    floor: float = -0.2
    """Height of the floor in the base frame [m]."""
    postures: int = 50
    """Number of postures."""
    seed: int = 0
    """Decides what is drawn: the same seed gives the same numbers."""
    suggest: int = 0
    """So many more units are placed where they help most."""
    out: str = ""
    """Skin file to write, with --suggest: the units there are, and the new ones."""
    figure: str = ""
    """File for a figure of the arm, ending in .png, .pdf or .svg."""
    json: str = ""
    """File for the numbers."""
    replace: bool = False
    """Go on if a file to write is there already."""

    def run(self) -> int:
        """Measure, show, and write what is asked for."""
        from pretouch.cli.skin_coverage import skin_coverage

        skin_coverage(self)
        return 0
