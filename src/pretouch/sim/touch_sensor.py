"""Touch sensors of a simulated skin: force-sensing resistors under the cases of units, with the faults they have."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.sim.plant import Plant, PointForce
from pretouch.sim.under_way import ROUNDING_S, UnderWay
from pretouch.types import RangeReadings, TouchReadings, TouchStatus


@dataclass(frozen=True)
class TouchErrors(Checked):
    """Errors of touch sensors. Values of the FSR 402 (Interlink, data sheet of the 400 series) where it has them."""

    period_s: Positive = 0.02
    """Time between readings [s]: a unit sends 50 times a second."""
    shortest_s: Positive = 0.01
    """Least time from one reading to the next: a touch that begins or ends is reported as soon as it has passed [s]."""
    period_jitter: Fraction = 0.02
    """Standard deviation of the period as a fraction of it: as of the range finders."""
    rise_s: Positive = 0.005
    """Time constant with which the foam under the case passes a force on [s]: an assumption; the resistor itself
    follows within 3 us."""
    gain_error: Fraction = 0.06
    """Error of each sensor's force as a fraction of it, uniform up to this: 6 % from part to part."""
    noise: Fraction = 0.02
    """Standard deviation of a reading as a fraction of the force: 2 % of one part."""
    noise_floor_n: NonNegative = 0.03
    """Standard deviation without a force [N]: an assumption."""
    hysteresis: Fraction = 0.1
    """Fraction by which a falling force reads too high: 10 %."""
    release: Fraction = 0.7
    """Part of the smallest force below which a touch is over, so that noise does not make it begin again and again:
    as in the firmware."""
    step_n: Positive = 0.02
    """Resolution of the reading [N]: 12 bit over about 9 N, the few lowest bits of which are noise."""
    most_n: Positive = 10.0
    """Force from which on the reading stays the same [N]: the end of its range."""
    latency_s: NonNegative = 0.008
    """Least time from measurement to arrival [s]: as of the range finders."""
    jitter_s: NonNegative = 0.004
    """Mean of the exponential addition to it [s]."""
    dropout: Fraction = 0.005
    """Probability that a reading is lost on its way."""


class TouchSample(NamedTuple):
    """One measurement of a sensor."""

    unit: int
    """Index of the unit in the skin."""
    time: float
    """Time of the measurement [s]."""
    contact: bool
    force: float
    """[N], NaN of a sensor that tells contact only."""


Forces = Callable[[float], list[PointForce]]
"""Returns the forces that act on the arm at a time."""
Send = Callable[[TouchSample], None] | None


def no_forces(_time: float) -> list[PointForce]:
    """Lay no force on the arm."""
    return []


class TouchSensors:
    """The touch sensors of a skin's units, which measure contacts of the simulated arm and forces applied to it.

    A unit on a force's link measures the force if it acts within the patch: no farther from the unit's axis than its
    radius, and on the unit's side of the link. The sensor measures the component that presses on the unit.
    """

    def __init__(
        self, plant: Plant, skin: Skin, params: TouchErrors, seed: int, laid: Forces = no_forces, send: Send = None
    ) -> None:
        """Mount the sensors on a simulated arm; the seed decides their errors, phases, noise and losses.

        Args:
            plant: the arm; forces of its contacts are measured.
            skin: the units; those with a `touch` have a sensor.
            params: how they err.
            seed: of what chance decides.
            laid: forces that act on the arm without a contact of the simulation, base frame.
            send: handed each measurement as it is made, to bring it to where it is read: `touch` then tells nothing.
        """
        self._plant, self._params, self._laid, self._send = plant, params, laid, send
        self._rng = np.random.default_rng([seed, 5])
        self._patches = [(int(k), touch) for k in skin.touching if (touch := skin.units[k].touch) is not None]
        self._link, self._T, count = skin.link, skin.T_link_sensor, len(self._patches)
        self._gain = 1.0 + params.gain_error * self._rng.uniform(-1, 1, count)
        self._due: list[float] = self._rng.uniform(0, params.period_s, count).tolist()
        self._last = np.full(count, -np.inf)
        self._passed, self._before, self._on = np.zeros(count), np.zeros(count), np.zeros(count, np.bool_)
        self._time = plant.time
        self._sent = UnderWay[TouchSample]()
        none = np.full(len(skin), int(TouchStatus.NONE), dtype=np.int64)
        self._newest = TouchReadings(
            np.full(len(skin), -np.inf), np.zeros(len(skin), np.bool_), np.full(len(skin), np.nan), none
        )
        self.silenced: set[int] = set()
        """Indices of units that no longer send."""
        plant.before_each_step(self._sample)

    def touch(self) -> TouchReadings:
        """Return the newest reading of each unit that has arrived by now."""
        newest = self._newest
        for unit, stamp, contact, force in self._sent.arrived(self._plant.time + ROUNDING_S):
            if stamp > newest.stamp[unit]:
                newest.stamp[unit], newest.contact[unit], newest.force[unit] = stamp, contact, force
                newest.status[unit] = TouchStatus.OK
        return TouchReadings(newest.stamp.copy(), newest.contact.copy(), newest.force.copy(), newest.status.copy())

    def _sample(self, time: float) -> None:
        forces = self._plant.contact_forces() + self._laid(time)
        follow = 1.0 - np.exp(-max(time - self._time, 0.0) / self._params.rise_s)
        self._time = time
        for i, (unit, patch) in enumerate(self._patches):
            pressed = sum(self._pressing(unit, patch, force) for force in forces)
            self._passed[i] += follow * (pressed - self._passed[i])
            level = patch.force_min_n * (self._params.release if self._on[i] else 1.0)
            changed = (self._passed[i] * self._gain[i] >= level) != self._on[i]
            if time >= self._due[i] or (changed and time - self._last[i] >= self._params.shortest_s):
                self._measure(i, unit, patch, time)

    def _pressing(self, unit: int, patch: TouchPatch, force: PointForce) -> float:
        """Return how much of a force presses on a unit [N]."""
        link = int(self._link[unit])
        if force.link != link:
            return 0.0
        rotation = self._plant.link_rotation[link] @ self._T[unit, :3, :3]
        origin = self._plant.link_position[link] + self._plant.link_rotation[link] @ self._T[unit, :3, 3]
        x, y, z = rotation.T @ (force.point - origin)
        if x * x + y * y > patch.radius_m**2 or abs(z) > patch.radius_m:
            return 0.0
        return max(0.0, -float(force.force @ rotation[:, 2]))

    def _measure(self, i: int, unit: int, patch: TouchPatch, time: float) -> None:
        p, rng = self._params, self._rng
        self._last[i], self._due[i] = time, time + p.period_s * (1.0 + p.period_jitter * rng.standard_normal())
        force = float(self._passed[i])
        falling, self._before[i] = force < self._before[i], force
        force *= self._gain[i] * (1.0 + (p.hysteresis if falling else 0.0))
        force += (p.noise_floor_n + p.noise * force) * rng.standard_normal()
        force = round(min(max(force, 0.0), p.most_n) / p.step_n) * p.step_n
        self._on[i] = force >= patch.force_min_n * (p.release if self._on[i] else 1.0)
        arrival, lost = time + p.latency_s + rng.exponential(p.jitter_s), rng.random() < p.dropout
        if unit in self.silenced:
            return
        sample = TouchSample(unit, time, bool(self._on[i]), force if patch.measures_force else np.nan)
        if self._send:
            self._send(sample)
        elif not lost:
            self._sent.send(arrival, sample)


@dataclass(frozen=True)
class SimulatedTouchSkin:
    """The port `TouchSkin` of a simulated arm: what range finders, or another skin, read, and what touch sensors do."""

    read: Callable[[], RangeReadings]
    touch: Callable[[], TouchReadings]
