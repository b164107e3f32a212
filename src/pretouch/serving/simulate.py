"""Simulated units in real time: an arm moves on its path, a hand comes and goes, and the units tell a receiver of it.

Where the receiver is does not matter to them: in another program, or on another machine. The arm's own controller has
its readings within the process, so that the arm moves whatever becomes of the datagrams.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from pretouch.checks import Checked, NonNegative
from pretouch.control.path import Circle, Path
from pretouch.controller import Controller
from pretouch.errors import HardwareError, ParameterError
from pretouch.hardware.keys import Keys
from pretouch.loop import Cycle
from pretouch.loop import run as turn_on
from pretouch.params import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.serving.fleet import Fleet, FleetParams
from pretouch.sim.hand import Hand, HandGoal
from pretouch.sim.imu import ImuParams, Imus, ImuSample
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.posture import brought_to
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders, RangeSample
from pretouch.sim.scene import HandSpec, SceneSpec, fixtures
from pretouch.types import FloatArray

_SLICE_S = 0.002
"""The simulation moves on by so much at once [s]: how late a datagram may leave."""
_LATE_S = 0.1
"""A machine that is later than this leaves the time out [s]."""
_SETTLE_S = 0.2
"""Time the arm stands before the controller starts [s]: the observer's transient is over."""
_SAY_S = 1.0
_ANSWER_S = 3.0
"""Time without any unit in session after which it is said that nobody answers [s]: a session takes 0.1 s to begin."""

Measured = TypeVar("Measured", RangeSample, ImuSample)


def _fleet() -> FleetParams:
    return FleetParams(imu=ImuParams())


@dataclass(frozen=True)
class SimulateOptions(Checked):
    """What to simulate, and where to send it."""

    model: RobotModel
    """The arm."""
    skin: Skin
    """Its units."""
    keys: Keys
    """Keys of all of them; the receiver has the same."""
    host: str
    """Name or address of the receiver."""
    port: int
    """Its UDP port."""
    fleet: FleetParams = field(default_factory=_fleet)
    """Units, their IMUs and reboots, and the network to the receiver."""
    path: Path = field(default_factory=Circle)
    """What the end-effector follows."""
    profile: Profile = field(default_factory=Profile)
    """Parameters of the controller."""
    hand: bool = True
    """Whether a person's hand comes and goes."""
    silenced: frozenset[str] = frozenset()
    """Names of units that send nothing."""
    stuck: frozenset[str] = frozenset()
    """Names of units whose range finder repeats its first reading."""
    seed: int = 0
    """Decides all that is random."""
    duration_s: NonNegative = 0.0
    """How long [s]; 0: until it is stopped."""

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown = sorted((self.silenced | self.stuck) - set(self.skin.ids))
        if unknown:
            raise HardwareError(f"There is no unit {', '.join(unknown)}: choose from {', '.join(self.skin.ids)}.")
        if self.seed < 0:
            raise ParameterError(f"SimulateOptions.seed is {self.seed}: it must be at least 0.")


class Visitor:
    """A hand that every 15 s comes to 0.3 m before the robot's hand, stays with it for 5 s, and goes."""

    away = (1.2, 0.0, 0.8)

    def __init__(self, link: int) -> None:
        self._link = link

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Be where this time of the visit wants it, without any force to speak of."""
        here = 5.0 <= time % 15.0 < 10.0
        before = plant.link_position[self._link] + np.array([0.3, 0.0, 0.0])
        return HandGoal(before if here else np.array(self.away), 20.0)


class _RealTime:
    """The port `Clock`: moves arm and units on as real time passes."""

    def __init__(self, plant: Plant, period: float) -> None:
        self._plant, self._slices = plant, max(1, round(period / _SLICE_S))
        self._slice = period / self._slices
        self._fleet: Fleet | None = None
        self._start = self._next = 0.0
        self.now = 0.0
        """Real time since the start [s]: the units' time."""
        self.left_out = 0.0
        """Time that the machine was too slow to simulate [s]."""

    def begin(self, fleet: Fleet) -> None:
        """Let the time of arm and units begin."""
        self._fleet, self._start = fleet, time.monotonic()
        self._next = self._start

    def tick(self) -> float:
        """Wait for the next control period and return the simulated time [s]."""
        for _ in range(self._slices):
            self._next += self._slice
            wait = self._next - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            elif wait < -_LATE_S:
                self._next -= wait
                self.left_out -= wait
            self._look()
            self._plant.advance(self._slice)
            if self._fleet:
                self._fleet.step(self._look)
        return self._plant.time

    def _look(self) -> float:
        self.now = time.monotonic() - self._start
        return self.now

    def real(self, sample: Measured) -> Measured:
        """Return a measurement with its instant in real time."""
        return sample._replace(time=self.now + sample.time - self._plant.time)


class _Teller:
    """Says each second how it goes."""

    def __init__(self, fleet: Fleet, clock: _RealTime, say: Callable[[str], None]) -> None:
        self._fleet, self._clock, self._say = fleet, clock, say
        self._next, self._sent = _SAY_S, 0
        self._answered, self._named = 0.0, False

    def record(self, cycle: Cycle) -> None:
        if self._clock.now >= self._next:
            self._next += _SAY_S
            self._say(self._line(cycle))
            self._name_receiver()

    def _name_receiver(self) -> None:
        """Say once that a receiver does not answer."""
        now, sending = self._clock.now, [unit for unit in self._fleet.units if not unit.silent]
        if not sending or any(unit.in_session for unit in sending):
            self._answered, self._named = now, False
        elif not self._named and now - self._answered >= _ANSWER_S:
            self._named = True
            host, port = self._fleet.receiver
            self._say(
                f"Nobody answers at {host}:{port}: start `pretouch skin monitor` there with the same keys, or check"
                " address and firewall."
            )

    def _line(self, cycle: Cycle) -> str:
        fleet, step = self._fleet, cycle.step
        silent = [name for name, unit in zip(fleet.ids, fleet.units, strict=True) if not unit.in_session]
        sent, self._sent = fleet.sent - self._sent, fleet.sent
        speed = float(np.linalg.norm(step.ee_velocity))
        parts = [
            f"{self._clock.now:7.1f} s  {step.mode.value:5}  {speed:.2f} m/s",
            f"{sent} datagrams",
            f"{len(fleet.ids) - len(silent)} of {len(fleet.ids)} units in session",
        ]
        if silent:
            parts.append(f"not {', '.join(silent)}")
        if fleet.lost:
            parts.append(f"{fleet.lost} could not be sent")
        if self._clock.left_out:
            parts.append(f"this machine is too slow by {self._clock.left_out:.1f} s")
        return "; ".join(parts)


def run(options: SimulateOptions, done: Callable[[], bool], say: Callable[[str], None]) -> None:
    """Simulate until `done` says so or the time is over; the arm is brought to rest and the sockets are closed.

    `say` is handed a line each second, and a sentence when nobody answers. A receiver that cannot be found is a
    HardwareError.
    """
    model, skin, profile = options.model, options.skin, options.profile
    scene = SceneSpec(hand=HandSpec(start=Visitor.away)) if options.hand else SceneSpec()
    fleet = Fleet(skin.ids, options.keys, options.fleet, options.seed, (options.host, options.port))
    try:
        for name, unit in zip(skin.ids, fleet.units, strict=True):
            unit.silent, unit.stuck = name in options.silenced, name in options.stuck
        plant = Plant(model, scene, PlantParams(), brought_to(model, options.path.point(0.0)), options.seed)
        if options.hand:
            Hand(plant, Visitor(model.ee))
        near, clock = RangeFinderParams(), _RealTime(plant, profile.task.control_period_s)
        # both draw the same numbers: what is sent is what the arm's own controller has
        felt = RangeFinders(plant, skin, near, options.seed)
        RangeFinders(plant, skin, near, options.seed, lambda sample: fleet.take_range(clock.real(sample)))
        if options.fleet.imu is not None:
            Imus(plant, skin, options.fleet.imu, options.seed, lambda sample: fleet.take_imu(clock.real(sample)))
        controller = Controller(model, skin, fixtures(scene), options.path, profile)
        plant.advance(_SETTLE_S)
        clock.begin(fleet)
        end = options.duration_s or np.inf
        turn_on(controller, plant, felt, clock, _Teller(fleet, clock, say), lambda _: done() or clock.now >= end)
    finally:
        fleet.close()
