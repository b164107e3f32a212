"""Runs to record: an arm that follows commands exactly, what its units and its force estimate say drawn from a seed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

from pretouch.controller import Controller, ControllerState
from pretouch.loop import Cycle
from pretouch.recording.reader import Recorded, open_recording
from pretouch.recording.ros import encode, value_of
from pretouch.recording.verify import verify
from pretouch.recording.writer import Recording
from pretouch.robot.description import RobotDescription
from pretouch.types import ControlStep, Inputs, RangeReadings, RobotState
from tests.fuzz.invariants import same

Change = Callable[[int, Inputs], Inputs]
"""Changes the inputs of the cycle of a number."""


@dataclass
class Run:
    """A controller that is turned, and its cycles."""

    controller: Controller
    seed: int = 0
    time: float = 0.0
    cycles: list[Cycle] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.q = self.controller.model.description.q_ready.copy()
        self.qd = np.zeros(self.controller.model.n)
        self.state: ControllerState = self.controller.init(self.inputs().robot)

    def inputs(self) -> Inputs:
        """What the arm and its units report now; one reading in ten shows no target, a force in twenty is a push."""
        k, n = len(self.controller.skin), self.controller.model.n
        wrench = self.rng.normal(scale=0.3, size=6)
        if self.rng.random() < 0.05:
            wrench[:3] += self.rng.normal(scale=30.0, size=3)
        readings = RangeReadings(
            np.full(k, self.time - self.time % 0.02), self.rng.uniform(0.1, 1.0, k),
            np.where(self.rng.random(k) < 0.1, 2, 0).astype(np.int64),
        )  # fmt: skip
        measured = self.q + self.rng.normal(scale=1e-4, size=n)
        robot = RobotState(self.time, measured, self.qd.copy(), self.q.copy(), self.qd.copy(), np.ones(n), wrench)
        return Inputs(self.time, robot, readings, bool(self.rng.random() < 0.1))

    def turn(self, change: Callable[[Inputs], Inputs] = lambda inputs: inputs) -> Cycle:
        """Turn the controller once, with the inputs changed, and follow its command."""
        inputs, before = change(self.inputs()), self.state
        step, self.state = self.controller.step(before, inputs)
        period = self.controller.profile.task.control_period_s
        self.qd, self.q = step.command, self.q + step.command * period
        self.time += period
        self.cycles.append(Cycle(inputs, before, step, self.state))
        return self.cycles[-1]


def custom_arm(folder: Path) -> RobotDescription:
    """An arm of two joints that no installation has."""
    place = folder / "two.xml"
    place.write_text("""<mujoco><compiler angle="radian"/><worldbody><body name="a">
      <joint name="j1" range="-2 2" limited="true"/><geom type="capsule" size="0.05 0.1" mass="1"/>
      <body name="b" pos="0 0 0.3"><joint name="j2" axis="0 1 0" range="-2 2" limited="true"/>
      <geom type="capsule" size="0.04 0.1" mass="1"/></body></body></worldbody></mujoco>""")
    two = np.ones(2)
    return RobotDescription("two", place, "b", 2.1 * two, 3.3 * two, 9.0 * two, 0.1 * two, "a test\nof two lines")


def record(run: Run, place: Path, cycles: int, change: Change = lambda _, inputs: inputs, about: Any = None) -> Run:
    """Record a run as it turns, with the inputs changed, and close the file."""
    with Recording(place, run.controller, about) as recording:
        for k in range(cycles):
            recording.record(run.turn(lambda inputs, k=k: change(k, inputs)))
    return run


def recorded_run(place: Path, controller: Controller, cycles: int) -> Run:
    """Turn a controller, record it, and close the file."""
    return record(Run(controller), place, cycles)


def read_whole(place: Path) -> Recorded:
    """Open a recording, and read all of it."""
    recorded = open_recording(place)
    for _ in recorded:
        pass
    _ = recorded.runs[0].profile, recorded.stamps()
    return recorded


def assert_replays(run: Run, folder: Path, change: Change, cycles: int) -> Recorded:
    """Record a run whose inputs are changed: they are read back to the bit, but for nonsense, and so is each step."""
    record(run, folder / "a.mcap", cycles, change)
    recorded = open_recording(folder / "a.mcap")
    for kept, cycle in zip(recorded, run.cycles, strict=True):
        assert kept.inputs is None or same(kept.inputs, cycle.inputs)
        assert kept.snapshot is None or same(kept.snapshot, cycle.before)
    verdict = verify(recorded)
    assert verdict.exact
    assert verdict.agrees
    return recorded


def changed(
    source: Path,
    place: Path,
    change: Callable[[str, int, bytes], bytes | None] = lambda topic, number, data: data,
    schema: Callable[[str, bytes], bytes] = lambda topic, text: text,
    per_chunk: int = 1_000_000,
    **options: Any,
) -> Path:
    """Write a recording anew as another tool does, so many messages to a chunk; `options` go to its writer.

    Messages are changed by topic and number (None leaves one out), definitions by topic.
    """
    with source.open("rb") as old, place.open("wb") as new:
        writer = Writer(new, **options)
        writer.start("ros2", "another tool")
        channels: dict[str, int] = {}
        schemas: dict[int, int] = {}
        for i, (kind, channel, message) in enumerate(make_reader(old).iter_messages(log_time_order=False)):
            topic = channel.topic
            data = change(topic, int.from_bytes(message.data[4:12], "little"), message.data)
            if data is None:
                continue
            if kind.id not in schemas:
                schemas[kind.id] = writer.register_schema(kind.name, "ros2msg", schema(topic, kind.data))
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schemas[kind.id])
            writer.add_message(channels[topic], message.log_time, data, message.publish_time)
            if i % per_chunk == per_chunk - 1:
                writer.flush()
        writer.finish()
    return place


def steps_changed(source: Path, place: Path, changes: dict[int, Callable[[ControlStep], ControlStep]]) -> Path:
    """Write a recording anew, its steps of some numbers changed."""

    def change(topic: str, number: int, data: bytes) -> bytes:
        if topic != "/pretouch/step" or number not in changes:
            return data
        return encode(changes[number](value_of(ControlStep, data)), number)

    return changed(source, place, change)
