"""Parameters of coverage: the approaching object, the units, and the time of a detection."""

import math
from dataclasses import dataclass, replace

from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.coverage.sighting import GRID_M
from pretouch.errors import ParameterError
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor


@dataclass(frozen=True)
class CoverageParams(Checked):
    """A ball and the arm that approach each other straight. Figures without a source are ours."""

    object_radius_m: Positive = 0.05
    """Radius of the ball [m]: a fist, as in the simulation."""
    object_speed_m_s: NonNegative = 0.5
    """Its speed v_o [m/s]."""
    arm_speed_m_s: Positive = 0.3
    """Speed v_a at which the arm moves towards it [m/s]: the task's."""
    deceleration_m_s2: Positive = 0.6
    """Deceleration a with which the arm brakes [m/s^2] (`BrakingParams.deceleration_m_s2`)."""
    rate_hz: Positive = 50.0
    """Readings of a unit a second [Hz]: VL53L1X, short mode."""
    latency_s: NonNegative = 0.04
    """Time from a measurement to a motion [s]: `BrakingParams.latency_s` less the period of a reading."""
    range_m: Positive = 1.3
    """Farthest target that fills the cone [m]: VL53L1X, short mode."""
    way_m: Positive = 0.8
    """Length of the straight way, which has to be free [m]: about a person's reach."""
    reflectance: Fraction = 0.5
    """Diffuse reflectance at 940 nm: skin and light cloth reach 0.5 and more."""
    reflectance_limit: Positive = 0.17
    """Reflectance of a target that fills the cone and is just visible at `range_m` (data sheet: grey)."""
    self_margin_m: NonNegative = 0.06
    """Distance before the return of the arm or the room from which a reading belongs to it [m]
    (`PerceptionParams.self_margin_m`)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first + self.run > self.last:
            raise ParameterError(
                f"At these speeds an object must be seen {self.warning_m:.2f} m before contact, but the paths are only"
                f" {self.way_m:g} m long: give lower speeds, a greater deceleration, or longer paths (way_m)."
            )

    def standing(self) -> "CoverageParams":
        """Return the same for objects at rest, with ways of twice the stopping distance."""
        still = Resting(**vars(self) | {"object_speed_m_s": 0.0})
        return replace(still, way_m=max(2 * still.warning_m, (still.first + still.run) * GRID_M))

    @property
    def closing_m_s(self) -> float:
        """Closing speed of both [m/s]."""
        return self.object_speed_m_s + self.arm_speed_m_s

    @property
    def braking_m(self) -> float:
        """Distance that closes while the arm comes to rest [m]: v_a^2 / (2 a) of the arm, v_o v_a / a of the object."""
        v_a, v_o = self.arm_speed_m_s, self.object_speed_m_s
        return v_a * (v_a / 2 + v_o) / self.deceleration_m_s2

    @property
    def reading_m(self) -> float:
        """Distance that closes in the period of a reading [m]."""
        return self.closing_m_s / self.rate_hz

    @property
    def last_reading_m(self) -> float:
        """Distance at the last measurement in time [m]."""
        return self.closing_m_s * self.latency_s + self.braking_m

    @property
    def warning_m(self) -> float:
        """Distance at which an object has to come into view for a reading in time [m]."""
        return self.last_reading_m + self.reading_m

    @property
    def light_m2(self) -> float:
        """Square of the distance at which a ball that fills the cone is just visible [m^2]; its mean slant is 2/3."""
        return 2.0 / 3.0 * self.reflectance / self.reflectance_limit * self.range_m**2

    def seen_by(self, sensor: Sensor) -> tuple[float, float, int]:
        """Return farthest target [m], `light_m2` and `run` of a sensor: these parameters are the VL53L1X's."""
        farther, slower = sensor.grey_m / PAPER_SENSOR.grey_m, sensor.timing[2] / PAPER_SENSOR.timing[2]
        return self.range_m * farther, self.light_m2 * farther**2, _steps(self.reading_m * slower)

    @property
    def first(self) -> int:
        """Index of the nearest grid point of a way that counts."""
        return _steps(self.last_reading_m)

    @property
    def last(self) -> int:
        """Index of the farthest grid point."""
        return int(self.way_m / GRID_M + 1e-9)

    @property
    def run(self) -> int:
        """Steps of the grid within which there is a reading."""
        return _steps(self.reading_m)


@dataclass(frozen=True)
class Resting(CoverageParams):
    """The same for an object at rest, whose place counts: a cone that is wider than the ball does not tell it."""

    def seen_by(self, sensor: Sensor) -> tuple[float, float, int]:
        """See `CoverageParams`."""
        farthest, light, run = super().seen_by(sensor)
        return min(farthest, self.object_radius_m / math.tan(sensor.angle / 2)), light, run


def _steps(way: float) -> int:
    return math.ceil(way / GRID_M - 1e-9)
