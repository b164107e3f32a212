"""The command `pretouch serve-fci`: a simulated arm behind the vendor's interface."""

import csv
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from pretouch.arms.simulated.skin import VisitingHand
from pretouch.checks import Check, Count, Fraction
from pretouch.control.path import Circle
from pretouch.control.path import Path as ArmPath
from pretouch.errors import HardwareError, ParameterError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import skin_for
from pretouch.signals import ended
from pretouch.sim.hand import HandScript, Pusher
from pretouch.sim.paper_scenes import dynamic_pushes, static_path, static_scene
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import FloatArray
from pretouch.units.keys import load_keys
from pretouch_fci.arm import ServedArm, ServedSetup
from pretouch_fci.gripper import object_of
from pretouch_fci.pushes import push_of
from pretouch_fci.server import FciOptions, FciServer
from pretouch_fci.typed import HELP, TypedPushes, say
from pretouch_fci.units import UnitsSetup

_LARGEST_M = 10.0
"""Largest edge of a box [m]."""


@dataclass(frozen=True)
class ServeFci(FciOptions):
    """Serve a simulated Panda or FR3 to programs that use the vendor's library, as the robot itself would be."""

    robot: Literal["panda", "fr3"] = "panda"
    """The robot: panda speaks protocol 5 (libfranka 0.9), fr3 protocol 10 (libfranka 0.18 and later)."""
    scene: Literal["empty", "static", "dynamic"] = "empty"
    """Surroundings: empty, static (that experiment's board), or dynamic (that experiment's person)."""
    trajectory: Literal["circle", "line"] = "circle"
    """Path of the static experiment, beside which its board stands."""
    side: Literal["+y", "-y"] = "+y"
    """Side of the board."""
    stiffness: Annotated[float, Check(low=0.0, open_low=True, high=1e6)] = 25_000.0
    """Contact stiffness of board and boxes [N/m]."""
    box: list[str] = field(default_factory=list)
    """Boxes in the empty scene, each X,Y,Z:DX,DY,DZ: centre and edges [m], base frame."""
    start: str = "ready"
    """Initial posture of the arm: ready, its usual one, path, that at the start of the path, or seven joint angles
    between commas [rad]."""
    seed: Count = 0
    """Seed of the simulated arm and scene: each arm has different errors and noise, each scene different positions."""
    push: list[str] = field(default_factory=list)
    """Forces on the arm at its TCP, each T:FX,FY,FZ or T:FX,FY,FZ:DURATION [s, N, s], base frame, up to
    1000 N. T counts from the start of the server; in lockstep, from the first motion on, while the arm moves."""
    hand: bool = False
    """Let a person's hand come and go before the arm, in the empty scene."""
    object: str = ""
    """Object between the fingers of the gripper, WIDTH:KG, such as 0.04:0.5 [m, kg]; by default none."""
    units: str = ""
    """HOST:PORT of the receiver of the arm's sensor units; by default they are switched off."""
    keys: str = ""
    """File of the keys of the units, the same as the receiver's."""
    skin: str = ""
    """Skin file; by default the sixteen units that come with the package."""
    loss: Fraction = 0.0
    """Share of the units' datagrams lost, in either direction."""
    stdin: bool = False
    """Take what a person would type, such as 0.5:0,15,0:0.2 (0.5 s from now), from the standard input though it is no
    terminal, and end with it."""
    truth: str = ""
    """CSV file for the ground truth: true force on the arm and joint positions, each millisecond."""

    def run(self) -> None:
        """Serve until interrupted, or, if asked to, until the first client has gone."""
        with ServedArm(_setup(self)) as arm, _truth(self.truth) as watch, FciServer(arm, self, watch, say) as server:
            host, port = server.address
            pace = "lockstep" if self.lockstep else "real time"
            gripper = f"gripper at port {server.gripper_address[1]}"
            say(f"Listening at {host}:{port} (FCI {server.protocol.version}, {pace}), {gripper}.")
            typed = TypedPushes(arm, sys.stdin, self.stdin, self.lockstep)
            if typed.possible and not self.stdin:
                say(HELP)
            server.serve(lambda: ended() or typed.take())


def _setup(c: ServeFci) -> ServedSetup:
    model = RobotModel(robot_named(c.robot))
    if (c.hand or c.box) and c.scene != "empty":
        raise ParameterError(f"--{'hand' if c.hand else 'box'} needs --scene empty, and it is {c.scene}.")
    scene, hand, path = _scene(c, model)
    q = _posture(c.start, model, path)
    pushes, gripped = tuple(map(push_of, c.push)), object_of(c.object) if c.object else None
    return ServedSetup(model, c.robot, q, scene, hand, pushes, _units(c, model), gripped, c.seed)


def _posture(start: str, model: RobotModel, path: ArmPath) -> FloatArray:
    """Read where the arm stands at first (7,) [rad]."""
    match start:
        case "ready":
            return model.description.q_ready.copy()
        case "path":
            return brought_to(model, path.point(0.0))
    try:
        q = np.array([float(angle) for angle in start.split(",")])
    except ValueError:
        q = np.array([np.nan])
    if q.shape != (model.n,) or not np.all((q >= model.q_min) & (q <= model.q_max)):
        limits = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in zip(model.q_min, model.q_max, strict=True))
        raise ParameterError(
            f"--start is {start!r}: give ready, path, or {model.n} joint angles between commas, within {limits} [rad]."
        )
    return q


def _scene(c: ServeFci, model: RobotModel) -> tuple[SceneSpec, HandScript | None, ArmPath]:
    """Return what is there, what its hand does, and the path of the end-effector."""
    match c.scene:
        case "static":
            return static_scene(c.trajectory, c.side, c.stiffness, c.seed), None, static_path(c.trajectory, c.side)
        case "dynamic":
            return SceneSpec(hand=HandSpec()), Pusher(model, dynamic_pushes(c.seed)), Circle()
    path, boxes = static_path(c.trajectory, c.side), tuple(_box(text, c.stiffness) for text in c.box)
    if c.hand:
        return SceneSpec(boxes, HandSpec(start=VisitingHand.away)), VisitingHand(model.ee), path
    return SceneSpec(boxes), None, path


def _box(text: str, stiffness: float) -> Box:
    """Read a box from X,Y,Z:DX,DY,DZ."""
    center, _, size = text.partition(":")
    try:
        (x, y, z), (dx, dy, dz) = (map(float, part.split(",")) for part in (center, size))
    except ValueError:
        x = y = z = dx = dy = dz = np.nan
    if not np.all(np.isfinite([x, y, z])) or not all(0 < side <= _LARGEST_M for side in (dx, dy, dz)):
        raise ParameterError(
            f"--box is {text!r}: give centre and edges, such as 0.5,0.3,0.4:0.3,0.04,0.24 [m], with edges of up to"
            f" {_LARGEST_M:g} m."
        )
    return Box(f"box {text}", (x, y, z), (dx / 2, dy / 2, dz / 2), stiffness)


def _units(c: ServeFci, model: RobotModel) -> UnitsSetup | None:
    if not c.units:
        return None
    host, _, port = c.units.rpartition(":")
    if not host or not port.isdecimal():
        raise HardwareError(f"--units is {c.units!r}: give address and port of the receiver, such as 127.0.0.1:7337.")
    if not c.keys:
        raise HardwareError("--units needs --keys, the file with the keys that the receiver has.")
    return UnitsSetup(skin_for(model, c.skin), load_keys(Path(c.keys)), (host, int(port)), c.loss)


@contextmanager
def _truth(place: str) -> Iterator[Callable[[float, ServedArm], None]]:
    """Open the file of the truth, if there is to be one."""
    if not place:
        yield lambda _time, _arm: None
        return
    try:
        Path(place).touch()
    except OSError as error:
        raise ParameterError(f"The truth cannot be written to {place} ({error.strerror}): give another file.") from None
    with Path(place).open("w", buffering=1, newline="") as file:  # each line at once: others may read it meanwhile
        table = csv.writer(file)
        table.writerow(["time_s", *(f"force_{axis}_N" for axis in "xyz"), *(f"q{i}_rad" for i in range(1, 8))])

        def watch(time: float, arm: ServedArm) -> None:
            q = np.asarray(arm.plant.mj_data.qpos[: arm.model.n])
            table.writerow([f"{time:.3f}", *map(repr, arm.true_force.tolist()), *map(repr, q.tolist())])

        yield watch
