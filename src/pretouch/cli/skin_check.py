"""The commands `pretouch skin check-unit` and `skin simulate`: one unit tried by hand, and units that are simulated."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path

import numpy as np

from pretouch.arms.simulated.skin import run
from pretouch.calibration.stamps import by_time
from pretouch.cli.options import OptionalFile, Words
from pretouch.errors import HardwareError, ParameterError
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Sensor, sensor_called
from pretouch.sensing.skin import skin_for
from pretouch.sensing.unit import NetworkUnits
from pretouch.session.terminal import say
from pretouch.sim.imu import ImuParams
from pretouch.sim.paper_scenes import assumptions, placement_for
from pretouch.types import FloatArray, RangeStatus
from pretouch.units import HOST, PORT
from pretouch.units.fleet import ChannelParams, Fleet, FleetParams, NetworkParams
from pretouch.units.keys import Keys, load_keys, save_keys
from pretouch.units.skin import NetworkSkin
from pretouch.units.skin_recording import unit_trace
from pretouch.units.unit import Received
from pretouch.units.watch import UnitWatch
from pretouch.units.wire import ZONE, ZONES, Flag

_TARGET = [RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED, RangeStatus.MIN_CLIPPED]
_NEAR_M = 0.15
"""A card that covers zones is nearer than this [m]."""
_SLOW_HZ, _FAST_HZ, _GRID_S = 0.4, 5.0, 0.005
"""Frequencies of a motion by hand that the IMU tells well [Hz], and the steps in which it is integrated [s]."""
_STAMP_S = 0.03
"""Mean error of a zone's stamp in the realistic simulation, 25 ms, and of this measurement [s]."""
_STEPS = (
    "Hold a white card at rest {distance:g} m before the unit, square to it, so that it fills the view.",
    "Hold the unit over a table, its window down, and move it up and down by 0.2 m, about once a second.",
    "Hold the card 5 cm before the half of the window towards -x of the pose in the skin file.",
    "Hold the card 5 cm before the half of the window towards -y.",
)


@dataclass(frozen=True)
class CheckUnit:
    """Measure bursts, delay and order of zones of one unit, with a card and by hand, and say what may be claimed."""

    id: str
    """Name of the unit."""
    keys: Path
    """File of the units' keys."""
    sensor: str = "vl53l5cx"
    """Type of its range finder."""
    zones: int = 4
    """Zones along a side, of a sensor with zones."""
    distance: float = 0.3
    """Distance of the card at rest [m]."""
    host: str = HOST
    """Address to listen at. Real units need 0.0.0.0, which is every address of this machine."""
    port: int = PORT
    """UDP port to listen at."""
    seconds: float = 20.0
    """Time of each step [s]."""
    pause: float = 8.0
    """Time to get ready for a step [s]."""

    def run(self) -> int:
        """Measure; return 1 if the unit is not as its type says."""
        kind, parts = sensor_called(self.sensor, "The unit", {}), []
        kind = replace(kind, zones=self.zones) if kind.zones > 1 else kind
        unit = NetworkUnits((self.id,), (kind.zones,))
        with NetworkSkin(unit, load_keys(self.keys), self.host, self.port) as receiver:
            watch = UnitWatch(receiver, 0.25)
            for step in _STEPS[: 4 if kind.zones > 1 else 2]:
                say(f"{step.format(distance=self.distance)} It begins in {self.pause:g} s.")
                list(watch.updates(self.pause))
                parts.append([one for update in watch.updates(self.seconds) for one in update.samples])
                if not any(one.sample.flags & Flag.RANGE_NEW for one in parts[-1]):
                    raise HardwareError(f"No range of {self.id} came: `pretouch skin monitor` shows what is wrong.")
        numbers, wrong = judged(kind, self.distance, parts)
        for name, number in numbers.items():
            say(f"{name:20} {np.array2string(np.asarray(number), precision=3)}")
        say("\n".join(wrong) or "As its type says: what the realistic simulation shows may be claimed of it.")
        return int(bool(wrong))


def _frames(samples: Sequence[Received]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stamps (F,) by the unit's clock and ages as sent (F,) [s], distances of all zones (F, Z) [m], NaN for none."""
    fresh, rows = [one.sample for one in samples if one.sample.flags & Flag.RANGE_NEW], []
    for one in fresh:
        table = np.frombuffer(one.zones, ZONE, offset=ZONES.size) if one.zones else None
        mm, status = (one.range_mm, one.range_status) if table is None else (table["mm"], table["status"])
        rows.append(np.where(np.isin(status, _TARGET), 1e-3 * np.atleast_1d(mm), np.nan))
    age = 1e-6 * np.array([one.range_age_us for one in fresh])
    return 1e-6 * np.array([one.time_us for one in fresh]) - age, age, np.array(rows)


def delays(samples: Sequence[Received]) -> FloatArray:
    """Return how much older each zone's measurements are than their stamps (Z,) [s].

    The unit is moved along its axis: the acceleration of its IMU, integrated twice, is the motion by the same clock.
    Zones whose distances do not follow it are NaN.
    """
    time, _, distance = _frames(samples)
    imu = by_time(unit_trace([replace(one, offset=0.0, bound=0.0) for one in samples]).imu)
    if len(imu.stamp) < 100:
        raise HardwareError("Of the motion, the IMU was not heard for a full second: check its wiring and the network.")
    grid = np.arange(imu.stamp[0], imu.stamp[-1], _GRID_S)
    f, a = np.fft.rfftfreq(len(grid), _GRID_S), np.interp(grid, imu.stamp, imu.acceleration[:, 2])
    inside = (f > _SLOW_HZ) & (f < _FAST_HZ)
    spectrum = np.where(inside, np.fft.rfft((a - a.mean()) * np.hanning(len(grid)) ** 0.25), 0.0)
    x, v = (np.fft.irfft(spectrum / (2j * np.pi * np.where(inside, f, 1.0)) ** k, len(grid)) for k in (2, 1))
    share = (time - grid[0]) / (grid[-1] - grid[0])
    # what the IMU does not tell: the distance's mean, and slow changes of it
    slow = np.cos(np.pi * np.outer(share, np.arange(2 * _SLOW_HZ * (grid[-1] - grid[0]) + 2)))
    late = np.full(distance.shape[1], np.nan)
    for zone, d in enumerate(distance.T):
        use, lag, along = np.isfinite(d) & (share > 0.1) & (share < 0.9), 0.0, 0.0
        for _ in range(4 if use.sum() > 3 * slow.shape[1] else 0):
            at = time[use] - lag
            columns = np.column_stack([np.interp(at, grid, x), np.interp(at, grid, v), slow[use]])
            along, rate, *_ = np.linalg.lstsq(columns, d[use])[0]
            lag -= rate / along if along else 0.0  # 0: it did not move at all
        late[zone] = lag if abs(along + 1.0) < 0.4 else np.nan
    return late


def judged(kind: Sensor, distance: float, parts: Sequence[Sequence[Received]]) -> tuple[dict[str, object], list[str]]:
    """Return what the steps show of a unit of a type, by name, and sentences on what is not as the type says."""
    (time, age, rest), n, (blind_s, delay_s, period) = _frames(parts[0]), kind.zones, kind.timing
    inner = np.add.outer(n * np.arange(n // 4, n - n // 4), np.arange(n // 4, n - n // 4)).ravel()
    middle, late = rest[:, inner], delays(parts[1])
    lit = np.flatnonzero(np.isfinite(middle).mean(axis=1) > 1 / 8)
    burst = float(np.diff(time[lit])[np.diff(lit) > 1].max(initial=0.0))
    numbers = {"valid": np.isfinite(middle).mean(), "longest burst [s]": burst, "told delay [s]": age.min()}
    noise = np.nanstd(rest[:, np.isfinite(rest).any(axis=0)], axis=0).mean()
    numbers |= {"error [m]": np.nanmedian(middle) - distance, "noise [m]": noise}
    wrong, follow = [], late[inner][np.isfinite(late[inner])]
    if burst > blind_s + 2.0 * period:
        wrong.append(f'Bursts of "no target" last for {burst:.2f} s: set blind_s = {burst:.2f} for its type.')
    if not len(follow):
        wrong.append("Its distances did not follow its IMU: move it straight along its axis, farther or faster.")
    elif abs(mean := float(follow.mean())) > _STAMP_S:
        wrong.append(f"It is {mean:.3f} s older than stamped, not 0.025 at most: its delay is {delay_s + mean:.3f} s.")
    for axis, part in enumerate(parts[2:]):
        near = np.moveaxis((np.nan_to_num(_frames(part)[2], nan=9.0) < _NEAR_M).mean(axis=0).reshape(n, n), 1 - axis, 0)
        if not near[: n // 2].mean() > 0.3 > 3.0 * near[n // 2 :].mean():
            wrong.append(f"Its zones do not begin at -{'xy'[axis]}: turn its pose in the skin file.")
    return numbers | {"hidden delay [s]": late.reshape(n, n)}, wrong


@dataclass(frozen=True)
class Simulate:
    """Simulate a skin that sends what real units send: an arm on its path, and a hand that comes and goes."""

    keys: Path
    """File of the units' keys, created if it is missing. `pretouch skin monitor` needs the same file."""
    skin: OptionalFile = None
    """Skin file; by default the seven units that come with the package, of profile pretouch the sixteen."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    host: str = HOST
    """Name or address of the receiver."""
    port: int = PORT
    """UDP port of the receiver."""
    channel: ChannelParams = field(default_factory=ChannelParams)
    """Loss and delay of datagrams to the receiver; on the way back as many are lost, and the delay is shorter."""
    reboot_every: float = 0.0
    """Time between two reboots of each unit [s]; 0: none."""
    silenced: Words = ()
    """Names of units that send nothing, separated by commas."""
    stuck: Words = ()
    """Names of units whose range finder repeats its first reading, separated by commas."""
    hand: bool = True
    """True if a person's hand comes and goes."""
    profile: str = "paper"
    """Profile of the arm's controller, or PROFILE:GROUP.FIELD=VALUE."""
    seed: int = 0
    """Decides all that is random."""
    duration: float = 0.0
    """Time to simulate [s]; 0: until Ctrl-C."""

    def run(self) -> None:
        """Simulate until interrupted, or for the given time."""
        if self.seed < 0 or not 0.0 <= self.duration < inf:
            raise ParameterError(f"--seed is {self.seed}, --duration {self.duration:g} s: give 0 or more of both.")
        up = self.channel
        down = ChannelParams(up.loss, 0.15 * up.delay_s, 0.3 * up.jitter_s, jitter_shape=2.0)
        params = FleetParams(network=NetworkParams(up, down), imu=ImuParams(), reboot_every_s=self.reboot_every)
        model, profile, end = RobotModel(robot_named(self.arm)), find_profile(self.profile), self.duration or inf
        skin = skin_for(model, self.skin, paper=profile.sight.memory is None)
        placement = placement_for(model)
        for sentence in assumptions(model, placement):
            say(sentence)
        keys = load_keys(self.keys) if self.keys.exists() else Keys().with_new(skin.network.ids)
        if not self.keys.exists():
            save_keys(keys, self.keys)
            say(f"Made keys for {len(keys)} units: {self.keys}")
        with closing(Fleet(skin.network, keys, params, self.seed, (self.host, self.port))) as fleet:
            fleet.set_faults(self.silenced, self.stuck)
            run(model, skin, fleet, placement.path("circle", -1.0), profile, self.hand, lambda now: now >= end, say)
