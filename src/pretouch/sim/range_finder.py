"""Model of the range finders of a skin, seen through the simulated room: that of the VL53L1X, as each type has it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.compiled import compiled, kernel
from pretouch.errors import ParameterError
from pretouch.sensing.sensor import Capacitive, Sensor, cone_rays
from pretouch.sensing.skin import Skin
from pretouch.sim.capacitive import STREAM, Electrode
from pretouch.sim.plant import ArmInWorld
from pretouch.sim.rays import Geoms, cast, geoms_of, placed, turned
from pretouch.sim.under_way import ROUNDING_S, UnderWay
from pretouch.types import FloatArray, IntArray, RangeReadings, RangeStatus


@dataclass(frozen=True)
class RangeFinderParams(Checked):
    """How the sensors of a skin err."""

    mode: Literal["short", "long"] = "short"
    """Distance mode."""
    rate_hz: NonNegative = 0.0
    """Readings of each unit in a second [Hz]; 0: as often as the mode allows, 50 in short mode and 7 in long mode."""
    rings: int = 2
    """Circles of rays that fill the cone; 2 make 19 rays."""
    reflectance: Fraction = 0.5
    """Diffuse reflectance of all surfaces at 940 nm; skin and light cloth reach 0.5 and more."""
    reflectance_limit: Positive = 0.17
    """Reflectance of a target that fills the cone and is just seen at the mode's greatest distance (sheet: grey)."""
    slant_power: Positive = 1.0
    """Power of the cosine of incidence by which returns weaken: 1 for matt surfaces (Lambert), greater for glossy ones,
    which throw light back in a lobe (Phong's exponent). An assumption where it is not 1."""
    merge_m: Positive = 0.1
    """Returns within this of the nearest one are taken as one target, weighted by their strength [m]."""
    noise_floor_m: NonNegative = 0.003
    """Standard deviation at zero distance [m]."""
    noise_rate: NonNegative = 0.006
    """Growth of the standard deviation with distance for a target that fills the cone; weak targets are noisier."""
    sigma_limit_m: Positive = 0.015
    """Standard deviation above which a reading has status SIGMA [m] (data sheet default)."""
    offset_max_m: NonNegative = 0.01
    """Constant error of each sensor, uniform up to this [m]; the data sheet allows 20 to 25 mm in all."""
    latency_s: NonNegative = 0.008
    """Least time from measurement to arrival [s]: radio and receiver."""
    jitter_s: NonNegative = 0.004
    """Mean of the exponential addition to it [s]."""
    period_jitter: Fraction = 0.02
    """Standard deviation of the period as a fraction of it."""
    period_factor: Annotated[float, Check(low=1.0)] = 1.0
    """Times longer than that the period is: units that share a channel, or a processor."""
    dropout: Fraction = 0.005
    """Probability that a reading is lost on its way."""

    def period_of(self, sensor: Sensor) -> float:
        """Time between readings of a unit with a sensor [s]."""
        return self.period_factor * (1.0 / self.rate_hz if self.rate_hz else sensor.ranging(self.mode).period_s)


class RangeSample(NamedTuple):
    """All that a sensor says of one measurement."""

    unit: int
    """Index of the unit in the skin."""
    time: float
    """When it was measured [s]."""
    distance: float
    """[m]; 0 without a target."""
    status: int
    """A `RangeStatus`."""
    sigma: float
    """Standard deviation of the distance [m]; 0 without a target."""
    signal: float
    """Rate of the light that came back [Mcps]."""
    ambient: float
    """Rate of other light [Mcps]."""
    spads: float
    """SPADs in use."""


class RangeFinders:
    """All sensors of a skin in a simulated room: the port `Skin`, sampled and held.

    Each unit measures at its own phase and rate, all of its zones at once; a reading arrives late, out of step with
    the others, or not at all. A unit sees everything but its own link: objects, hand, floor, and the rest of the arm.
    """

    def __init__(
        self, plant: ArmInWorld, skin: Skin, params: RangeFinderParams, seed: int,
        send: Callable[[RangeSample], None] | None = None,
    ) -> None:  # fmt: skip
        """Mount the sensors on a simulated arm; the seed decides offsets, phases, noise and losses.

        With `send`, that is handed each measurement as it is made and has to bring it to where it is read: latency,
        jitter and dropout are not these sensors' then, and `read` tells nothing. They measure the same either way.
        """
        self._plant, self._skin, self.params = plant, skin, params
        count, data, rays = len(skin), plant.mj_data, 1 + 3 * params.rings * (params.rings + 1)
        cones = np.array([cone_rays(params.rings, unit.sensor.angle) for unit in skin.units]).reshape(count, rays, 3)
        self._rng = np.random.default_rng([seed, 3])
        self._send, self._light = send, np.random.default_rng([seed, 4])
        offset = params.offset_max_m * self._rng.uniform(-1, 1, count)
        bodies, geoms = plant.first_body + skin.link, geoms_of(plant.mj_model, data)
        # a flat wall square to the beam is read at its distance, as by a calibrated sensor: rays at an angle meet it
        # farther away by 1 / cos, and with strength cos^3, which is slant, and the distance squared
        flat_wall = (cones[:, :, 2] ** 3).sum(axis=1) / (cones[:, :, 2] ** 2).sum(axis=1)
        kinds = np.empty((count, 3))
        for k, sensor in enumerate(unit.sensor for unit in skin.units):
            kinds[k] = sensor.ranging(params.mode).distance_max_m, sensor.nearest_m, sensor.noise
        self._finders = _Finders(
            data.xpos, data.xmat, bodies, skin.T_link_sensor, cones, np.column_stack([offset, flat_wall, kinds])
        )
        self._geoms, drift = geoms, np.random.default_rng([seed, STREAM])
        self._electrodes = {
            k: Electrode(unit.sensor, int(bodies[k]), skin.T_link_sensor[k], data, geoms, drift)
            for k, unit in enumerate(skin.units)
            if isinstance(unit.sensor, Capacitive)
        }
        self._boards: list[list[int]] = [np.flatnonzero(skin.board == one).tolist() for one in range(len(skin.mounted))]
        self._periods = [params.period_of(unit.sensor) for unit in skin.mounted]
        self._due: list[float] = self._rng.uniform(0, self._periods, len(self._periods)).tolist()
        self._sent = UnderWay[tuple[int, float, float, int]]()
        none = np.full(count, RangeStatus.NONE, dtype=np.int64)
        self._newest = RangeReadings(np.full(count, -np.inf), np.zeros(count), none)
        self.silenced: set[int] = set()
        """Indices of units that no longer send."""
        plant.before_each_step(self._sample)

    def change(self, params: RangeFinderParams) -> None:
        """Err in another way from the next measurement on; what was settled when they were mounted has to stay."""
        for name in ("mode", "rings", "offset_max_m"):
            if getattr(params, name) != getattr(self.params, name):
                raise ParameterError(
                    f"RangeFinderParams.{name} cannot change while the sensors run: create them again."
                )
        self.params, self._periods = params, [params.period_of(unit.sensor) for unit in self._skin.mounted]

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit that has arrived by now."""
        newest = self._newest
        for unit, stamp, distance, status in self._sent.arrived(self._plant.time + ROUNDING_S):
            if stamp > newest.stamp[unit]:
                newest.stamp[unit], newest.distance[unit], newest.status[unit] = stamp, distance, status
        return RangeReadings(newest.stamp.copy(), newest.distance.copy(), newest.status.copy())

    def _sample(self, time: float) -> float:
        p, rng, due = self.params, self._rng, list[tuple[int, float, float, bool]]()
        for board in [board for board, due_at in enumerate(self._due) if due_at <= time]:
            self._due[board] += self._periods[board] * (1.0 + p.period_jitter * rng.standard_normal())
            units, draws = self._boards[board], rng.standard_normal(len(self._boards[board])).tolist()
            arrival, lost = time + p.latency_s + rng.exponential(p.jitter_s), rng.random() < p.dropout
            due += [(unit, draw, arrival, lost) for unit, draw in zip(units, draws, strict=True)]
        measured = _measure(np.array(due).reshape(-1, 4), p.numbers, self._finders, self._geoms).tolist()
        for (unit, draw, arrival, lost), (distance, status, sigma, strength) in zip(due, measured, strict=True):
            if unit in self._electrodes:
                distance, status, sigma, strength = self._electrodes[unit].measure(time, draw)
            if unit in self.silenced:
                continue
            if self._send:
                light = _light(strength, self._light)
                self._send(RangeSample(unit, time, distance, int(status), sigma, *light))
            elif not lost:
                self._sent.send(arrival, (unit, time, distance, int(status)))
        return min(self._due, default=np.inf)


_SIGNAL_LIMIT_MCPS = 1.024
"""Signal of a target that is just detected [Mcps] (data sheet: readings below 1024 kcps are rejected)."""
_AMBIENT_MCPS = 0.3
"""Rate of ambient light indoors on all SPADs, of the size that units on a desk report [Mcps]; an assumption."""
_WANTED_MCPS = 20.0
"""The sensor uses so many SPADs that all rates together stay below this [Mcps] (its driver's default)."""
_SPADS = 256
"""SPADs of the whole array (data sheet)."""
_COUNTED_S = 0.01
"""Time in which photons are counted [s]: about half of the 20 ms budget; an assumption."""


def _light(strength: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Rates of signal and ambient light [Mcps], with the photons' noise, and SPADs in use, at a strength of returns."""
    rates = np.array([_SIGNAL_LIMIT_MCPS * strength, _AMBIENT_MCPS])
    share = min(1.0, _WANTED_MCPS / float(rates.sum()))
    signal, ambient = (rng.poisson(1e6 * share * rates * _COUNTED_S) / (1e6 * _COUNTED_S)).tolist()
    return signal, ambient, _SPADS * share


_OK, _SIGMA, _SIGNAL, _MIN_RANGE = (
    int(s) for s in (RangeStatus.OK, RangeStatus.SIGMA, RangeStatus.SIGNAL, RangeStatus.MIN_RANGE)
)


class _Finders(NamedTuple):
    """Where K sensors sit, and on what; and how the type of each measures."""

    position: FloatArray  # (L, 3) origins of the bodies [m], in MuJoCo's memory
    rotation: FloatArray  # (L, 9) rows of their rotation matrices
    link: IntArray  # (K,)
    T_link_sensor: FloatArray  # (K, 4, 4)
    cone: FloatArray  # (K, N, 3) unit vectors of the rays, sensor frame
    # (K, 5) constant error [m], factor that makes a flat wall read at its distance, farthest target [m], nearest [m],
    # times the noise of the VL53L1X
    figures: FloatArray


@compiled
def _measure(units: FloatArray, p: RangeFinderParams, finders: _Finders, geoms: Geoms) -> FloatArray:
    """Measure with N sensors at once: (N, 4) are their numbers, a normal draw for each, and more.

    Returns (N, 4): distance [m], status, standard deviation [m], and strength.
    """
    measured = np.empty((len(units), 4))
    for row in range(len(units)):
        distance, status, sigma, strength = _measured(int(units[row, 0]), units[row, 1], p, finders, geoms)
        measured[row, 0], measured[row, 1], measured[row, 2], measured[row, 3] = distance, status, sigma, strength
    return measured


@kernel
def _measured(
    unit: int, draw: float, p: RangeFinderParams, finders: _Finders, geoms: Geoms
) -> tuple[float, int, float, float]:
    """Measure with a sensor; `draw` is normal. Return distance [m], status, standard deviation [m], and strength.

    The nearest group of returns strong enough to be detected is reported. Strength falls with the square of the
    distance and the cosine of incidence. It is relative to a target that is just detected: one that fills the cone, at
    `distance_max`, square to the beam, of `reflectance_limit`, has 1 in all.
    """
    link, figures = finders.link[unit], finders.figures[unit]
    offset, calibration, distance_max, noise = figures[0], figures[1], figures[2], figures[4]
    origin, R = placed(finders.position[link], finders.rotation[link], finders.T_link_sensor[unit])
    rays = turned(R, finders.cone[unit])
    distance, normal, _ = cast(origin, rays, geoms, link, distance_max)
    brightness, count = p.reflectance / p.reflectance_limit, len(distance)
    strength = np.zeros(count)
    for i in range(count):
        if 0.0 <= distance[i] <= distance_max:
            # a ray that leaves a body began inside it: what presses on the sensor is at 0, not where the ray comes out
            outwards = rays[i, 0] * normal[i, 0] + rays[i, 1] * normal[i, 1] + rays[i, 2] * normal[i, 2]
            slant = abs(outwards)
            if outwards > 0:
                distance[i] = 0.0
            if p.slant_power != 1.0:
                slant = slant**p.slant_power
            ratio = distance_max / max(distance[i], 0.01)  # 10 mm: no return is infinitely strong
            strength[i] = brightness * slant * ratio * ratio / count
    total, mean = _nearest_group(distance, strength, p.merge_m)
    if total == 0.0:
        return 0.0, _SIGNAL, 0.0, sum(strength)
    mean *= calibration / total
    # shot noise: with a share of the light that a target filling the cone would return, 1 / sqrt(share) times the noise
    full = brightness * (distance_max / max(mean, 0.01)) ** 2
    sigma = p.noise_floor_m + p.noise_rate * mean * np.sqrt(max(1.0, full / total))
    trusted = sigma <= p.sigma_limit_m
    sigma *= noise
    measured = max(0.0, mean + offset + sigma * draw)
    if not trusted:
        return measured, _SIGMA, sigma, total
    if measured < figures[3]:
        return measured, _MIN_RANGE, sigma, total
    return measured, _OK, sigma, total


@kernel
def _nearest_group(distance: FloatArray, strength: FloatArray, merge_m: float) -> tuple[float, float]:
    """Strength of the nearest group of returns that is detected, and the sum of strength times distance; or zeros.

    A weak group hides nothing that is behind it.
    """
    start = 0.0
    while True:
        nearest = np.inf
        for i in range(len(distance)):
            if strength[i] > 0 and start <= distance[i] < nearest:
                nearest = distance[i]
        if nearest == np.inf:
            return 0.0, 0.0
        total, mean = 0.0, 0.0
        for i in range(len(distance)):
            if nearest <= distance[i] <= nearest + merge_m:
                total += strength[i]
                mean += strength[i] * distance[i]
        if total >= 1.0:
            return total, mean
        start = nearest + merge_m
