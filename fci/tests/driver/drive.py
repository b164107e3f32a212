"""Run as a process: drives an arm in lockstep through the vendor's library; prints what came of it as JSON."""

import gc
import json
import sys

import numpy as np

from pretouch.arms.franka.connection import FrankaClient, MotionAborted
from pretouch.arms.franka.limiter import SetPointLimiter
from pretouch.arms.franka.limits import LimiterParams, collision_behavior, motion_limits
from pretouch.arms.franka.state import FrankaState
from pretouch.errors import RobotError
from pretouch.profiles import profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


class Staircase:
    """Velocities that change every 10 ms, with the steps of a reaction to a contact, for so long [s]."""

    def __init__(self, client: FrankaClient, model: RobotModel, lasts: float = 1.5) -> None:
        self._limiter, self._lasts = SetPointLimiter(motion_limits(model, client.kind), LimiterParams()), lasts
        self.states = self.lost = 0
        self.force: list[float] = []

    def __call__(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        self.states += 1
        time = self.states // 10 * 0.01
        wave = 0.25 * np.sin(6.0 * time) + (0.4 if 0.5 < time < 0.8 or 1.2 < time < 1.3 else 0.0)
        over = time > self._lasts
        wanted = [0.0] * 7 if over else (wave * np.array([1.0, -0.5, 0.5, 0.3, 0.2, -1.0, 1.0])).tolist()
        velocity = np.array(self._limiter.step(state, wanted))
        self.lost += self._limiter.lost
        self.force = state.wrench[:3].tolist()
        return velocity, over and self._limiter.at_rest


def staircase(client: FrankaClient, model: RobotModel) -> dict:
    stairs = Staircase(client, model)
    client.control(stairs)
    return {"lost": stairs.lost, "mode": client.read().mode}


def contact(client: FrankaClient, model: RobotModel) -> dict:
    """Meet the contact that the server was told to make, recover, and go on."""
    client.set_collision_behavior(collision_behavior(profile("paper"), model))
    stairs, found = Staircase(client, model), {}
    try:
        client.control(stairs)
    except MotionAborted as error:
        found |= {"errors": list(error.errors), "trouble": str(error), "force": stairs.force}
    after = client.read()
    found |= {"mode": after.mode, "last_errors": list(after.last_motion_errors)}
    try:
        client.control(Staircase(client, model))
    except RobotError as error:
        found["refused"] = str(error)
    client.recover()
    client.control(Staircase(client, model, 0.2))
    return found


def raises(client: FrankaClient, model: RobotModel) -> dict:
    """Fail in the middle of a motion, and keep the exception, as a caller may; then move again."""
    stairs = Staircase(client, model)

    def failing(state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        if stairs.states == 300:
            raise RuntimeError("the disk is full")
        return stairs(state, since)

    kept: list[Exception] = []
    gc.disable()
    try:
        client.control(failing)
    except RuntimeError as error:
        kept.append(error)
    mode = client.read().mode
    client.control(Staircase(client, model, 0.2))
    return {"states": stairs.states, "trouble": str(kept[0]), "mode": mode}


def main(kind: str, address: str, task: str) -> None:
    tasks = {one.__name__: one for one in (staircase, contact, raises)}
    with FrankaClient(address, kind) as client:  # type: ignore[arg-type]
        print(json.dumps(tasks[task](client, RobotModel(robot_named(kind)))))


if __name__ == "__main__":
    main(*sys.argv[1:])
