"""Model of the range finders of a skin, seen through the simulated room: that of the VL53L1X, as each type has it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.sensing.sensor import Capacitive, cone_rays
from pretouch.sensing.skin import Skin
from pretouch.sim.capacitive import STREAM, Electrode
from pretouch.sim.flaws import flaw_arrays, flaws_of
from pretouch.sim.plant import Plant
from pretouch.sim.rays import Finders, Ranging, deliver, geoms_of, measure
from pretouch.sim.under_way import ROUNDING_S
from pretouch.types import RangeReadings, RangeStatus


@dataclass(frozen=True)
class RangeFinderParams(Checked):
    """Errors of a skin's sensors."""

    realistic: bool = False
    """True if each type errs as recordings of real ones show (`sim.flaws`), in place of a kinder sensor that only has
    noise and a constant error: bursts and losses of "no target", delays by zone, offsets, false statuses."""
    rate_hz: NonNegative = 0.0
    """Readings of each unit in a second [Hz]; 0: as often as its type allows."""
    rings: int = 2
    """Circles of rays that fill the cone; 2 make 19 rays."""
    reflectance: Fraction = 0.5
    """Diffuse reflectance of all surfaces at 940 nm; skin and light cloth reach 0.5 and more."""
    reflectance_limit: Positive = 0.17
    """Reflectance of a target that fills the cone and is just seen at `Sensor.grey_m` (sheet: grey)."""
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


class RangeSample(NamedTuple):
    """All that a sensor says of one measurement."""

    unit: int
    """Index of the unit in the skin."""
    time: float
    """Time of the measurement [s], as the unit stamps it."""
    distance: float
    """[m]; 0 without a target."""
    status: int
    """A `RangeStatus`."""
    sigma: float
    """Standard deviation of the distance [m]; 0 without a target."""
    ambient: float
    """Rate of light that is not the sensor's [Mcps]: it never repeats itself, with a target or without."""


Send = Callable[[RangeSample], None]


class RangeFinders:
    """All sensors of a skin in a simulated room: the port `SkinPort`, sampled and held.

    Each unit measures at its own phase and rate, all of its zones at once; a reading arrives late, out of step with
    the others, or not at all. A unit sees everything but its own link: objects, hand, floor, and the rest of the arm.
    """

    def __init__(
        self, plant: Plant, skin: Skin, params: RangeFinderParams, seed: int, send: Send | None = None
    ) -> None:
        """Mount the sensors on a simulated arm; the seed decides offsets, phases, noise and losses.

        With `send`, that is handed each measurement as it is made and has to bring it to where it is read: latency,
        jitter and dropout are not these sensors' then, and `read` tells nothing. They measure the same either way.
        """
        self._plant, self.params = plant, params
        count, data, rays = len(skin), plant.mj_data, 1 + 3 * params.rings * (params.rings + 1)
        cones = np.array([cone_rays(params.rings, unit.sensor.angle) for unit in skin.units]).reshape(count, rays, 3)
        self._rng = np.random.default_rng([seed, 3])
        self._send, self._light = send, np.random.default_rng([seed, 4])
        flaws = [flaws_of(unit.sensor) if params.realistic else None for unit in skin.units]
        offset = np.array([one.offset_max_m if one else params.offset_max_m for one in flaws])
        offset *= self._rng.uniform(-1, 1, count)
        bodies, geoms = skin.link, geoms_of(plant.mj_model, data)
        # a flat wall square to the beam is read at its distance, as by a calibrated sensor: rays at an angle meet it
        # farther away by 1 / cos, and with strength cos^3, which is slant, and the distance squared
        flat_wall = (cones[:, :, 2] ** 3).sum(axis=1) / (cones[:, :, 2] ** 2).sum(axis=1)
        kinds = np.empty((count, 3))
        for k, (sensor, own) in enumerate(zip((unit.sensor for unit in skin.units), flaws, strict=True)):
            farthest = sensor.farthest_m if own and own.seen_m else sensor.grey_m
            kinds[k] = farthest, sensor.nearest_m, sensor.noise
        finders = Finders(
            data.xpos, data.xmat, bodies, skin.T_link_sensor, cones, np.column_stack([offset, flat_wall, kinds])
        )
        drift = np.random.default_rng([seed, STREAM])
        self._electrodes = {
            k: Electrode(unit.sensor, int(bodies[k]), skin.T_link_sensor[k], data, geoms, drift)
            for k, unit in enumerate(skin.units)
            if isinstance(unit.sensor, Capacitive)
        }
        rate = params.rate_hz
        period = params.period_factor * np.array([1 / rate if rate else u.sensor.timing[2] for u in skin.mounted])
        self._ranging = Ranging(
            p=params.numbers,
            finders=finders,
            flaws=flaw_arrays([unit.sensor for unit in skin.mounted], params.realistic, params.reflectance_limit),
            geoms=geoms,
            first=np.append(skin.first, count),
            period=period,
            due=self._rng.uniform(0, period),
            silent=np.zeros(count, np.bool_),
            sent=np.empty((4 * count, 8)),
            rows=np.zeros(1, np.int64),
            whole=send is not None or bool(self._electrodes),
        )
        none = np.full(count, RangeStatus.NONE, dtype=np.int64)
        self._newest = RangeReadings(np.full(count, -np.inf), np.zeros(count), none)
        self.silenced: set[int] = set()
        """Indices of units that no longer send."""
        if self._ranging.whole or not plant.measure_each_step(self._ready, self._rng):
            plant.before_each_step(self._sample)

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit that has arrived by now."""
        newest, sent, rows = self._newest, self._ranging.sent, self._ranging.rows
        deliver(self._plant.time + ROUNDING_S, sent, rows, newest.stamp, newest.distance, newest.status)
        return RangeReadings(newest.stamp.copy(), newest.distance.copy(), newest.status.copy())

    def _ready(self) -> Ranging:
        """Return what `measure` takes, with room for a row of each sensor."""
        self._ranging.silent[:] = False
        self._ranging.silent[list(self.silenced)] = True
        sent, rows = self._ranging.sent, self._ranging.rows
        if 2 * rows[0] > len(sent):
            self.read()
            if 2 * rows[0] > len(sent):
                self._ranging = self._ranging._replace(sent=np.vstack([sent, np.empty_like(sent)]))
        return self._ranging

    def _sample(self, time: float) -> float:
        """Measure with the units that are due, and do what compiled code does not."""
        ranging = self._ready()
        first = int(ranging.rows[0])
        until = measure(time, ranging, self._rng)
        for row in ranging.sent[first : ranging.rows[0]]:
            unit = int(row[0])
            if unit in self._electrodes:
                row[3:7] = self._electrodes[unit].measure(time, float(row[7]))
            if self._send and unit not in self.silenced:
                stamp, _, distance, status, sigma = row[1:6].tolist()
                ambient = self._light.poisson(1e6 * _AMBIENT_MCPS * _COUNTED_S) / (1e6 * _COUNTED_S)
                self._send(RangeSample(unit, stamp, distance, int(status), sigma, ambient))
        if self._send:
            ranging.rows[0] = first
        return until


_AMBIENT_MCPS = 0.3
"""Rate of ambient light indoors on all SPADs, of the size that units on a desk report [Mcps]; an assumption."""
_COUNTED_S = 0.01
"""Time in which photons are counted [s]: about half of the 20 ms budget; an assumption."""
