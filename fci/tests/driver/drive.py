"""Run as a process: drives an arm in lockstep through the vendor's library; prints what came of it as JSON."""

import gc
import json
import sys
from dataclasses import asdict, dataclass, field

import numpy as np

from pretouch.errors import RobotError
from pretouch.hardware.franka.client import connect
from pretouch.hardware.franka.collision import collision_behavior
from pretouch.hardware.franka.errors import MotionAborted
from pretouch.hardware.franka.limiter import SetPointLimiter
from pretouch.hardware.franka.limits import LimiterParams, motion_limits
from pretouch.hardware.franka.state import FrankaState
from pretouch.hardware.franka.vendor import VendorClient
from pretouch.profiles import profile
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

LASTS_S = 1.5


@dataclass
class Result:
    states: int = 0
    lost: int = 0
    errors: list[str] = field(default_factory=list)
    trouble: str = ""
    refused: str = ""
    mode: str = ""
    last_errors: list[str] = field(default_factory=list)
    forces: list[list[float]] = field(default_factory=list)


class Staircase:
    """Velocities that change every 10 ms, with the steps of a reaction to a contact, for so long [s]."""

    def __init__(self, model: RobotModel, kind: str, lasts: float, result: Result) -> None:
        self._limiter = SetPointLimiter(motion_limits(model, kind), LimiterParams())
        self._lasts, self._result = lasts, result

    def answer(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        result = self._result
        result.states += 1
        time = result.states // 10 * 0.01
        wave = 0.25 * np.sin(6.0 * time) + (0.4 if 0.5 < time < 0.8 or 1.2 < time < 1.3 else 0.0)
        wanted = [0.0] * 7 if time > self._lasts else (wave * np.array([1.0, -0.5, 0.5, 0.3, 0.2, -1.0, 1.0])).tolist()
        velocity = np.array(self._limiter.step(state, wanted))
        result.lost += self._limiter.lost
        result.forces.append(state.wrench[:3].tolist())
        return velocity, time > self._lasts and self._limiter.at_rest


def staircase(client: VendorClient, model: RobotModel, result: Result) -> None:
    client.control(Staircase(model, client.kind, LASTS_S, result).answer)


def contact(client: VendorClient, model: RobotModel, result: Result) -> None:
    """Meet the contact that the server was told to make, recover, and go on."""
    client.set_collision_behavior(collision_behavior(profile("paper"), model))
    try:
        client.control(Staircase(model, client.kind, LASTS_S, result).answer)
    except MotionAborted as error:
        result.errors, result.trouble = list(error.errors), str(error)
    after = client.read()
    result.mode, result.last_errors = after.mode, list(after.last_motion_errors)
    try:
        client.control(Staircase(model, client.kind, LASTS_S, Result()).answer)
    except RobotError as error:
        result.refused = str(error)
    client.recover()
    client.control(Staircase(model, client.kind, 0.2, Result()).answer)


def raises(client: VendorClient, model: RobotModel, result: Result) -> None:
    """Fail in the middle of a motion, and keep the exception, as a caller may; then move again."""
    answer = Staircase(model, client.kind, LASTS_S, result).answer

    def failing(state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        if result.states == 300:
            raise RuntimeError("the disk is full")
        return answer(state, since)

    kept: list[Exception] = []
    gc.disable()
    try:
        client.control(failing)
    except RuntimeError as error:
        kept.append(error)
    result.trouble, result.mode = str(kept[0]), client.read().mode
    client.control(Staircase(model, client.kind, 0.2, Result()).answer)


def main(kind: str, address: str, task: str) -> None:
    model, result = RobotModel(panda() if kind == "panda" else fr3()), Result()
    with connect(address, kind) as client:  # type: ignore[arg-type]
        tasks = {one.__name__: one for one in (staircase, contact, raises)}
        tasks[task](client, model, result)
        if not result.mode:
            result.mode = client.read().mode
    print(json.dumps(asdict(result)))


if __name__ == "__main__":
    main(*sys.argv[1:])
