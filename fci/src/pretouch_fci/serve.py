"""What `pretouch serve-fci` does: builds scene, arm and units, and serves them until it is told to end."""

import csv
import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from pretouch.arms.simulated.skin import VisitingHand
from pretouch.control.path import Circle
from pretouch.control.path import Path as ArmPath
from pretouch.errors import HardwareError, ParameterError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import skin_for
from pretouch.signals import ended
from pretouch.sim.hand import HandScript
from pretouch.sim.paper_scenes import dynamic_pushes, static_path, static_scene
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.sim.tcp_push import TcpPush
from pretouch.types import FloatArray
from pretouch.units.keys import load_keys
from pretouch_fci.arm import ArmSetup, ServedArm
from pretouch_fci.gripper import object_of
from pretouch_fci.options import ServeOptions, drop_of
from pretouch_fci.pushes import push_of, typed_push
from pretouch_fci.server import FciServer
from pretouch_fci.units import UnitsSetup

if TYPE_CHECKING:
    from pretouch_fci.command import ServeFci

_say = partial(print, flush=True)
_BUTTONS: dict[str, Callable[[ServedArm], None]] = {
    "stop": ServedArm.press_stop,
    "release": lambda arm: arm.press_stop(False),
    "guide": ServedArm.press_guiding,
    "let go": lambda arm: arm.press_guiding(False),
}
"""What is typed for the user stop and the buttons at the flange."""
_TIME = "time"
"""What is typed to be told the arm's time."""
_LONGEST_LINE = 256
"""Characters of a line that is typed."""
_LAG_S = 0.2
"""How long the arm's estimate of a push that has ended is still looked at [s]."""
_STIFFEST = 1e6
"""Largest stiffness of board and boxes [N/m]."""
_LARGEST_M = 10.0
"""Largest edge of a box [m]."""


def serve_fci(command: "ServeFci") -> None:
    """Serve until interrupted, or, if asked to, until the first client has gone."""
    c = command
    drop = drop_of(c.drop) if c.drop else None
    options = ServeOptions(c.host, c.port, c.lockstep, c.patience, c.grace, drop, c.once)
    with (
        ServedArm(_setup(command)) as arm,
        _truth(c.truth) as watch,
        FciServer(arm, options, watch, _say) as server,
    ):
        host, port = server.address
        pace = "lockstep" if c.lockstep else "real time"
        gripper = f"gripper at port {server.gripper_address[1]}"
        _say(f"Listening at {host}:{port} (FCI {server.protocol.version}, {pace}), {gripper}.")
        typed = TypedPushes(arm, sys.stdin, c.stdin, c.lockstep)
        if typed.possible and not c.stdin:
            _say(
                "Type +x, -x, +y, -y, +z or -z and Enter to push the hand, or a force such as 0,15,0 [N];"
                " stop presses the user stop, release releases it; guide presses the buttons at the flange, let go"
                " releases them; time tells the arm's time."
            )
        server.serve(lambda: ended() or typed.take())


class TypedPushes:
    """Pushes that a person at the terminal types, one a line, or a program writes."""

    def __init__(self, arm: ServedArm, source: TextIO, program: bool = False, lockstep: bool = False) -> None:
        """Take the arm that is pushed, and what is typed at: a terminal, or a pipe of a `program`, which ends it.

        In `lockstep` nothing is done while somebody leads the arm, whose time passes at the machine's own speed.
        """
        self._arm, self._text, self._program, self._lockstep = arm, b"", program, lockstep
        self._lines: list[str] = []
        self._push: TcpPush | None = None
        self._rest, self._largest = np.zeros(3), 0.0
        self._descriptor = source.fileno() if program or source.isatty() else -1

    @property
    def possible(self) -> bool:
        """Whether there is somebody to listen to."""
        return self._descriptor >= 0

    def take(self) -> bool:
        """Have what was typed come, and say how it was measured; True once the program that typed has gone."""
        self._follow()
        if self.possible and not self._lines and select.select([self._descriptor], [], [], 0)[0]:
            self._read()
        while self._lines and self._ready:
            self._do(self._lines.pop(0))
        return self._program and not self.possible and not self._lines

    def _read(self) -> None:
        """Take in lines; what stands behind the last end is one at the end of all, and of a long one its beginning."""
        read = os.read(self._descriptor, 4096)
        *lines, self._text = (self._text + (read or b"\n")).split(b"\n")
        self._text = self._text[: _LONGEST_LINE + 1]
        self._lines = [line.decode(errors="replace") for line in lines if line.strip()]
        if not read:
            self._descriptor = -1

    @property
    def _ready(self) -> bool:
        # while the arm still swings after a motion, its time would depend on when the line arrived
        return self._arm.moving or self._arm.settled or (self._arm.led and not self._lockstep)

    def _do(self, line: str) -> None:
        now = self._arm.pushes.now
        if len(line) > _LONGEST_LINE:
            _say(f"A line of more than {_LONGEST_LINE} characters is left out.")
            return
        line = line.strip()
        if line in _BUTTONS:
            _BUTTONS[line](self._arm)
            return
        if line == _TIME:
            _say(f"The arm's time is {now:.3f} s.")
            return
        try:
            self._push = typed_push(line, now)
            self._arm.pushes.add(self._push)
            self._rest, self._largest = self._estimate(), 0.0
        except ParameterError as error:
            _say(str(error))

    def _follow(self) -> None:
        """Note how much of the newest push the arm's own estimate shows, and say it once the push is over."""
        push = self._push
        if push is None:
            return
        size = float(np.linalg.norm(push.force))
        along = float((self._estimate() - self._rest) @ np.array(push.force)) / size if size else 0.0
        self._largest = max(self._largest, along)
        if self._arm.pushes.now >= push.start + push.duration + _LAG_S:
            self._push = None
            _say(
                f"The push of {size:.0f} N is over. The arm's estimate of it came to {self._largest:.1f} N; the client"
                " says whether it took that for a contact."
            )

    def _estimate(self) -> FloatArray:
        """Force (3,) [N] that the arm reports, 0 where it has no estimate."""
        wrench = self._arm.report.wrench
        return np.zeros(3) if wrench is None else wrench[:3]


def _setup(c: "ServeFci") -> ArmSetup:
    model = RobotModel(robot_named(c.robot))
    if c.hand and c.scene != "empty":
        raise ParameterError(f"--hand needs --scene empty, and it is {c.scene}.")
    if c.box and c.scene != "empty":
        raise ParameterError(f"--box needs --scene empty, and it is {c.scene}.")
    if not 0 < c.stiffness <= _STIFFEST:
        raise ParameterError(f"--stiffness is {c.stiffness:g} N/m: give more than 0, and at most {_STIFFEST:g}.")
    if c.seed < 0:
        raise ParameterError(f"--seed is {c.seed}: give 0 or more.")
    scene, hand, path = _scene(c, model)
    q = _posture(c.start, model, path)
    pushes, gripped = tuple(map(push_of, c.push)), object_of(c.object) if c.object else None
    return ArmSetup(model, c.robot, q, scene, hand, pushes, _units(c, model), gripped, c.seed)


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


def _scene(c: "ServeFci", model: RobotModel) -> tuple[SceneSpec, HandScript | None, ArmPath]:
    """Return what is there, what its hand does, and the path of the end-effector."""
    from pretouch.sim.hand import Pusher

    match c.scene:
        case "static":
            return static_scene(c.trajectory, c.side, c.stiffness, c.seed), None, static_path(c.trajectory, c.side)
        case "dynamic":
            return SceneSpec(hand=HandSpec()), Pusher(model, dynamic_pushes(c.seed)), Circle()
    path, boxes = static_path(c.trajectory, c.side), tuple(_box(text, c.stiffness) for text in c.box)
    if isinstance(c.scene, Path):
        if not c.scene.is_file():
            raise ParameterError(f"--scene is {c.scene}: give empty, static, dynamic, or an MJCF file.")
        return SceneSpec(world=c.scene), None, path
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


def _units(c: "ServeFci", model: RobotModel) -> UnitsSetup | None:
    if not c.units:
        return None
    host, _, port = c.units.rpartition(":")
    if not host or not port.isdecimal():
        raise HardwareError(f"--units is {c.units!r}: give address and port of the receiver, such as 127.0.0.1:7337.")
    if not c.keys:
        raise HardwareError("--units needs --keys, the file with the keys that the receiver has.")
    skin = skin_for(model, c.skin)
    return UnitsSetup(skin, load_keys(Path(c.keys)), (host, int(port)))


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
