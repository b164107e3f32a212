"""A simulated arm in real time, whose units tell a receiver what they measure as real ones do."""

from dataclasses import dataclass, field
from typing import Self

from pretouch.arms.simulated.real_time import RealTime
from pretouch.checks import Checked, NonNegative
from pretouch.control.path import Circle, Path
from pretouch.errors import HardwareError, ParameterError
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.imu import ImuParams, Imus
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import plant_params_of
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec
from pretouch.sim.touch_sensor import TouchSensors
from pretouch.types import FloatArray, RobotState
from pretouch.units.fleet import Fleet, FleetParams
from pretouch.units.keys import Keys

SETTLE_S = 0.2
"""Time the arm stands before its time begins [s]: the observer's transient is over."""


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
    """Duration [s]; 0: until it is stopped."""

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown = sorted((self.silenced | self.stuck) - set(self.skin.network.ids))
        if unknown:
            raise HardwareError(f"Unknown unit {', '.join(unknown)}: choose from {', '.join(self.skin.network.ids)}.")
        if self.seed < 0:
            raise ParameterError(f"SimulateOptions.seed is {self.seed}: it must be at least 0.")


class SimulatedArm:
    """An arm with units, in real time: the ports `Robot` and `Clock`; a context manager, for the sockets.

    All happens while somebody waits for a tick: one thread.
    """

    def __init__(self, options: SimulateOptions, q: FloatArray, period: float, scene: SceneSpec | None = None) -> None:
        """Let an arm stand at q (n,) [rad] and switch its units on; the control period is in s.

        A receiver that cannot be found, and a unit without a key, are a HardwareError.
        """
        skin, seed = options.skin, options.seed
        self.fleet = Fleet(skin.network, options.keys, options.fleet, seed, (options.host, options.port))
        """Its units."""
        try:
            for name, unit in zip(self.fleet.ids, self.fleet.units, strict=True):
                unit.silent, unit.stuck = name in options.silenced, name in options.stuck
            self.plant = Plant(options.model, scene or SceneSpec(), plant_params_of(options.model.description), q, seed)
            self.clock = RealTime(self.plant, period)
            real, fleet = self.clock.real, self.fleet
            RangeFinders(self.plant, skin, RangeFinderParams(), seed, lambda sample: fleet.take_range(real(sample)))
            if len(skin.touching):
                TouchSensors(
                    self.plant, skin, options.fleet.touch, seed, send=lambda sample: fleet.take_touch(real(sample))
                )
            if options.fleet.imu is not None:
                Imus(self.plant, skin, options.fleet.imu, seed, lambda sample: fleet.take_imu(real(sample)))
        except BaseException:
            self.fleet.close()
            raise

    def begin(self) -> None:
        """Let its time begin."""
        self.plant.advance(SETTLE_S)
        self.clock.begin(self.fleet)

    def read(self) -> RobotState:
        """Return the newest state, by the simulated time."""
        return self.plant.read()

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point until the next command."""
        self.plant.command(qd)

    def tick(self) -> float:
        """Wait for the next control period and return the simulated time [s]."""
        tick = self.clock.tick()
        self.plant.take_log()  # nobody reads it, and it would grow without an end
        return tick

    def monotonic(self, simulated: float) -> float:
        """Return an instant of the simulated time by this machine's monotonic clock [s]."""
        return self.clock.monotonic(simulated)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.fleet.close()
