"""Run as a process: drives an arm in lockstep through the vendor's library; prints what came of it as JSON."""

import gc
import json
import sys
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path

import numpy as np
from lockstep import LockstepSkin, ReadingsAt, run_in_lockstep  # beside this script

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.hardware.franka.client import connect
from pretouch.hardware.franka.collision import collision_behavior
from pretouch.hardware.franka.errors import MotionAborted
from pretouch.hardware.franka.limiter import SetPointLimiter
from pretouch.hardware.franka.limits import LimiterParams, motion_limits, planned
from pretouch.hardware.franka.state import FrankaState, packed
from pretouch.hardware.franka.vendor import VendorClient
from pretouch.hardware.keys import load_keys
from pretouch.loop import Cycle
from pretouch.perception.scene_filter import floor_and_pedestal
from pretouch.profiles import profile
from pretouch.recording.writer import Recording
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.paper_scenes import static_path
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.types import FloatArray, RangeReadings

LASTS_S = 1.5
NEVER = RangeReadings(np.full(7, -np.inf), np.zeros(7), np.full(7, 255))


@dataclass
class Result:
    states: int = 0
    lost: int = 0
    digest: str = ""
    errors: list[str] = field(default_factory=list)
    trouble: str = ""
    refused: str = ""
    mode: str = ""
    last_errors: list[str] = field(default_factory=list)
    forces: list[list[float]] = field(default_factory=list)
    speed: float = 0.0
    heard: int = 0


class Staircase:
    """Velocities that change every 10 ms, with the steps of a reaction to a contact, for so long [s]."""

    def __init__(self, model: RobotModel, kind: str, lasts: float, result: Result) -> None:
        self._limiter = SetPointLimiter(motion_limits(model, kind), LimiterParams())
        self._lasts, self._result, self._hash = lasts, result, sha256()

    def answer(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        result = self._result
        result.states += 1
        self._hash.update(packed(state))
        time = result.states // 10 * 0.01
        wave = 0.25 * np.sin(6.0 * time) + (0.4 if 0.5 < time < 0.8 or 1.2 < time < 1.3 else 0.0)
        wanted = [0.0] * 7 if time > self._lasts else (wave * np.array([1.0, -0.5, 0.5, 0.3, 0.2, -1.0, 1.0])).tolist()
        velocity = np.array(self._limiter.step(state, wanted))
        result.lost += self._limiter.lost
        result.forces.append(state.wrench[:3].tolist())
        result.digest = self._hash.hexdigest()
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


def units(client: VendorClient, model: RobotModel, result: Result, port: str, keys: str) -> None:
    """Follow the paper's circle with what the units tell in the robot's time."""
    skin = paper_skin(model)
    controller = Controller(model, skin, fixtures(SceneSpec()), Circle(), profile("paper"))
    with LockstepSkin(skin, load_keys(Path(keys)), int(port)) as readings_at:
        follow(client, controller, result, readings_at)


def control(client: VendorClient, model: RobotModel, result: Result) -> None:
    """Follow the paper's circle without units."""
    controller = Controller(model, paper_skin(model), fixtures(SceneSpec()), Circle(), profile("blind"))
    follow(client, controller, result, lambda _: NEVER)


def follow(client: VendorClient, controller: Controller, result: Result, readings_at: ReadingsAt) -> None:
    """Turn a controller for a second and a half after the force window is full."""
    hashed, steps = sha256(), []

    def record(cycle: Cycle) -> None:
        steps.append(cycle.step)
        readings = cycle.inputs.readings
        hashed.update(cycle.step.command.tobytes() + cycle.step.force.tobytes())
        hashed.update(readings.stamp.tobytes() + readings.distance.tobytes() + readings.status.tobytes())
        result.heard = int(np.sum(np.isfinite(readings.stamp)))

    run_in_lockstep(client, controller, readings_at, record, 2.5)
    result.states, result.digest = len(steps), hashed.hexdigest()
    result.speed = float(np.linalg.norm(steps[-1].ee_velocity))


def experiment(
    client: VendorClient, model: RobotModel, result: Result, name: str, side: str, seconds: str, place: str, port: str,
    keys: str,
) -> None:  # fmt: skip
    """Follow the paper's circle with a profile and units, and record it."""
    found, skin = profile(name), paper_skin(model)
    client.set_collision_behavior(collision_behavior(found, model))
    path = Circle() if side == "none" else static_path("circle", side)  # type: ignore[arg-type]
    planned_model = RobotModel(planned(model.description, LimiterParams()))
    controller = Controller(planned_model, skin, floor_and_pedestal(SceneSpec().floor_height), path, found)
    with (
        LockstepSkin(skin, load_keys(Path(keys)), int(port)) as readings_at,
        Recording(Path(place), controller, {"robot": "a simulated arm in lockstep"}) as recording,
    ):
        run_in_lockstep(client, controller, readings_at, recording.record, float(seconds))


def main(kind: str, address: str, task: str, *more: str) -> None:
    model, result = RobotModel(panda() if kind == "panda" else fr3()), Result()
    with connect(address, kind) as client:  # type: ignore[arg-type]
        tasks = {one.__name__: one for one in (staircase, contact, control, experiment, raises, units)}
        tasks[task](client, model, result, *more)
        if not result.mode:
            result.mode = client.read().mode
    print(json.dumps(asdict(result)))


if __name__ == "__main__":
    main(*sys.argv[1:])
