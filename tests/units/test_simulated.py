"""A unit against a receiver of a few lines, written here from docs/reference/wire.md."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from pretouch.sim.imu import ImuParams, ImuSample
from pretouch.sim.range_finder import RangeSample
from pretouch.types import RangeStatus
from pretouch.units.keys import UnitKey
from pretouch.units.simulated import FIFO_MOST, SimulatedUnit, UnitParams
from pretouch.units.wire import (
    BEACON_SIZE,
    HELLO_SIZE,
    Beacon,
    Flag,
    Hello,
    Kind,
    Mac,
    Reset,
    Sample,
    decode_hello,
    decode_sample,
    imu_values,
    session_mac,
)

KEY = UnitKey("left", 7, bytes(range(32)))
MAC = Mac(KEY.key)
NONCE = b"nonce 01"


@dataclass
class Desk:
    """One unit, time, and all that it said."""

    unit: SimulatedUnit
    now: float = 0.0
    said: list[tuple[float, bytes]] = field(default_factory=list)
    number: int = 0
    every: float = 0.02
    """Time from one range to the next, a multiple of 1 ms [s]; infinite: none."""

    def pass_time(self, duration: float) -> list[tuple[float, bytes]]:
        """Let time pass in milliseconds, with ranges; return what was said in it."""
        begin = len(self.said)
        for _ in range(round(duration / 0.001)):
            self.now = round(self.now + 0.001, 6)
            if round(1000 * self.now) % (1000 * self.every) == 0:
                self.unit.take_range(RangeSample(0, self.now, 0.5, RangeStatus.OK, 0.006, 0.3))
            self.said += [(self.now, datagram) for datagram in self.unit.tick(self.now)]
        return self.said[begin:]

    def hellos(self, said) -> list[tuple[float, Hello]]:
        return [(at, decode_hello(d, MAC)) for at, d in said if d[3] == Kind.HELLO]

    def beacon(self, nonce: bytes = NONCE, key: Mac = MAC, challenge: bytes | None = None, unit: int = 7) -> None:
        """Answer the newest hello."""
        self.number += 1
        newest = self.hellos(self.said)[-1][1].challenge
        self.unit.receive_beacon(Beacon(unit, self.number, nonce).encode(key, challenge or newest), self.now)

    def session(self, nonce: bytes = NONCE) -> Mac:
        return session_mac(MAC, self.hellos(self.said)[-1][1].challenge, nonce)

    def open(self) -> "Desk":
        self.pass_time(0.2)
        self.beacon()
        return self

    def samples(self, said, session: Mac | None = None) -> list[Sample]:
        """Samples among what was said, of the newest session by default."""
        return [decode_sample(d, session or self.session()) for _, d in said if d[3] == Kind.SAMPLE]


@pytest.fixture
def desk():
    def made(seed: int = 0, imu: ImuParams | None = None, reboots=(), **params) -> Desk:
        return Desk(SimulatedUnit(KEY, UnitParams(**params), np.random.default_rng(seed), imu, reboots))

    return made


def test_out_of_session_a_unit_greets_ten_times_a_second_with_one_challenge(desk):
    on = desk()
    said = on.pass_time(5.0)
    hellos = on.hellos(said)
    assert len(said) == len(hellos) == pytest.approx(50, abs=3)
    assert {len(datagram) for _, datagram in said} == {HELLO_SIZE}
    assert len({hello.challenge for _, hello in hellos}) == 1
    assert hellos[0][1].reset == Reset.POWER_ON
    gaps = np.diff([at for at, _ in hellos])
    assert gaps.min() >= 0.074
    assert gaps.max() <= 0.127
    assert np.ptp(gaps) > 0.03
    assert np.diff([hello.uptime_us for _, hello in hellos]) == pytest.approx(1e6 * gaps, rel=1e-4)


def test_in_session_it_sends_fifty_samples_a_second_in_sequence(desk):
    on, told = desk().open(), []
    for _ in range(4):
        said = on.pass_time(0.5)
        told += on.samples(said)
        on.beacon()
    assert len(told) == pytest.approx(100, abs=2)
    assert [sample.sequence for sample in told] == list(range(1, len(told) + 1))
    assert all(sample.flags == Flag.RANGE_NEW for sample in told)
    assert [at for at, _ in said] == pytest.approx(np.arange(1.71, 2.20, 0.02)), "as soon as the unit has a range"
    assert [sample.range_age_us for sample in told] == pytest.approx([10_000] * len(told), abs=3)
    sample = told[-1]
    assert (sample.range_mm, sample.range_status, sample.range_sigma) == (500, 0, 24)
    assert sample.range_ambient == 38
    assert [s.range_stream for s in told] == sorted(s.range_stream for s in told)


def test_a_sample_echoes_the_newest_beacon_and_for_how_long_it_was_held(desk):
    on = desk().open()
    on.pass_time(0.3)
    on.beacon()
    sample = on.samples(on.pass_time(0.1))[-1]
    assert sample.beacon == 2
    assert sample.beacon_hold_us == pytest.approx(1e6 * (on.said[-1][0] - 0.5), abs=5)


def test_ranges_that_come_too_fast_wait_for_10_ms_to_pass_and_tell_their_age(desk):
    on = desk().open()
    on.every = 0.009
    on.pass_time(0.03)
    said = on.pass_time(0.5)
    told, times = on.samples(said), np.array([at for at, _ in said])
    assert np.diff(times).min() >= 0.01
    assert len(said) >= 45
    measured = 0.009 * np.floor(np.round((times - 0.01) / 0.009, 6))
    assert [sample.range_age_us for sample in told] == pytest.approx(1e6 * (times - measured), abs=3)


def test_between_ranges_that_come_too_slowly_there_are_samples_without_one(desk):
    on = desk().open()
    on.every = 0.06
    on.pass_time(0.06)
    told = on.samples(on.pass_time(1.2))
    new = [sample for sample in told if sample.flags & Flag.RANGE_NEW]
    assert len(new) == 20
    assert all(sample.range_age_us < 20_000 for sample in new)
    assert len(told) >= 39 * 1.2


def test_without_beacons_it_leaves_after_two_seconds_and_greets_with_a_new_challenge(desk):
    on = desk().open()
    before = on.hellos(on.said)[-1][1].challenge
    said = on.pass_time(3.0)
    hellos = on.hellos(said)
    assert max(at for at, d in said if d[3] == Kind.SAMPLE) == pytest.approx(2.2, abs=0.03)
    assert min(at for at, _ in hellos) == pytest.approx(2.2, abs=0.03)
    assert hellos[0][1].challenge != before


def test_only_a_fresh_beacon_of_its_own_opens_and_keeps_a_session(desk):
    on = desk()
    on.pass_time(0.2)
    on.beacon(key=Mac(bytes(32)))
    on.beacon(challenge=b"12345678")
    on.beacon(unit=8)
    on.unit.receive_beacon(b"PT" + bytes(BEACON_SIZE - 2), on.now)
    on.unit.receive_beacon(b"", on.now)
    assert not on.unit.in_session
    on.beacon()
    assert on.unit.in_session
    number = on.number
    on.pass_time(1.5)
    on.beacon(nonce=b"another1")
    on.number = number - 1
    on.beacon()  # the same number again
    on.pass_time(0.6)
    assert not on.unit.in_session


def test_after_the_last_sequence_number_it_leaves_its_session(desk):
    on = desk().open()
    session = on.session()
    on.pass_time(0.1)
    on.unit._sequence = 2**32 - 3
    said = on.pass_time(0.5)
    assert [sample.sequence for sample in on.samples(said, session)] == [2**32 - 2, 2**32 - 1]
    assert on.hellos(said)[0][1].challenge != on.hellos(on.said)[0][1].challenge


def test_a_reboot_begins_its_clock_at_nothing_and_takes_its_time(desk):
    on = desk(reboots=[1.0], boot_s=0.5).open()
    said = on.pass_time(1.8)
    hellos = on.hellos(said)
    assert max(at for at, d in said if d[3] == Kind.SAMPLE) < 1.0
    assert 1.5 <= hellos[0][0] < 1.61
    assert hellos[0][1].reset == Reset.WATCHDOG
    assert hellos[0][1].uptime_us == pytest.approx(1e6 * (hellos[0][0] - 1.0), abs=50)
    assert hellos[0][1].challenge != on.hellos(on.said)[0][1].challenge
    on.beacon()
    assert on.samples(on.pass_time(0.1))[0].sequence == 1


def test_reboots_may_go_on_for_ever(desk):
    on = desk(reboots=iter(np.arange(0.5, 1e6, 0.5)), boot_s=0.0)
    on.pass_time(2.2)
    assert len({hello.challenge for _, hello in on.hellos(on.said)}) == 5


def test_a_silent_unit_neither_sends_nor_hears(desk):
    on = desk().open()
    on.unit.silent = True
    assert on.pass_time(1.0) == []
    on.beacon()
    on.unit.silent = False
    assert on.pass_time(0.5), "its session has not run out"
    on.unit.silent = True
    on.pass_time(0.6)
    assert not on.unit.in_session, "it heard no beacon for 2 s"


def test_a_stuck_unit_repeats_itself_as_if_it_were_new(desk):
    on = desk().open()
    on.pass_time(0.1)
    on.unit.stuck = True
    told = on.samples(on.pass_time(1.0))
    assert all(sample.flags & Flag.RANGE_NEW for sample in told)
    assert len({(s.range_stream, s.range_mm, s.range_signal, s.range_ambient) for s in told}) == 1
    assert max(sample.range_age_us for sample in told) < 25_000, "it says that it is fresh"
    on.unit.stuck = False
    assert len({s.range_stream for s in on.samples(on.pass_time(0.2))}) > 5


def test_a_range_finder_that_says_nothing_is_late(desk):
    on = desk().open()
    on.every = np.inf
    on.pass_time(0.05)
    told = on.samples(on.pass_time(1.0))
    assert len(told) in (39, 40)
    assert all(sample.flags == Flag.RANGE_LATE for sample in told)
    assert told[-1].range_age_us == pytest.approx(1.05e6, abs=25_000)


def test_before_the_first_range_there_is_none(desk):
    on = desk()
    on.every = np.inf
    on.open()
    assert all(s.range_status == RangeStatus.NONE and not s.flags for s in on.samples(on.pass_time(0.2)))


MG = {2: 0.061, 4: 0.122, 8: 0.244, 16: 0.488}
MDPS = {125: 4.375, 245: 8.75, 500: 17.5, 1000: 35.0, 2000: 70.0}
"""One count by full scale, as the data sheet of the LSM6DS3 has it."""


@pytest.mark.parametrize("acceleration_range", MG)
@pytest.mark.parametrize("rate_range", MDPS)
def test_counts_of_the_simulated_imu_mean_on_the_wire_what_they_meant(desk, acceleration_range, rate_range):
    on = desk(imu=ImuParams(acceleration_range_g=acceleration_range, angular_rate_range_dps=rate_range)).open()
    on.unit.take_imu(ImuSample(0, on.now, np.array([100, -200, 300, 32767, -32768, 1])))
    sample = on.samples(on.pass_time(0.05))[0]
    acceleration, rate = imu_values(sample.imu, sample.imu_scale)
    mg, mdps = MG[acceleration_range], MDPS[rate_range]
    assert acceleration[0] == pytest.approx(np.array([32767, -32768, 1]) * mg * 9.80665e-3)
    assert rate[0] == pytest.approx(np.deg2rad(np.array([100, -200, 300]) * mdps * 1e-3))
    assert sample.imu_rate_hz == 416


def test_imu_samples_come_in_batches_without_a_gap(desk):
    on, told = desk(imu=ImuParams()).open(), []
    for count in range(1000):
        on.unit.take_imu(ImuSample(0, on.now, np.full(6, count)))
        told += on.samples(on.pass_time(0.002))
        if count % 200 == 0:
            on.beacon()
    index = told[0].imu_index
    for sample in told:
        assert sample.imu_index == index
        counts = np.frombuffer(sample.imu, "<i2").reshape(-1, 6)
        assert counts[:, 0].tolist() == list(range(index, index + sample.imu_count))
        assert sample.imu_age_us < 2100
        index += sample.imu_count
    assert index > 980


def test_a_fifo_that_runs_over_says_so_and_counts_what_is_lost(desk):
    on = desk(imu=ImuParams()).open()
    for count in range(FIFO_MOST + 50):
        on.unit.take_imu(ImuSample(0, on.now, np.full(6, count)))
    first, second = on.samples(on.pass_time(0.05))[:2]
    assert first.flags & Flag.IMU_LOST
    assert not second.flags & Flag.IMU_LOST
    assert (first.imu_index, first.imu_count, second.imu_index) == (50, 32, 82)


def test_clocks_differ_by_unit_and_drift_no_more_than_asked_for(desk):
    rates, starts = [], []
    for seed in range(40):
        on = desk(seed, drift_ppm=20.0)
        hellos = on.hellos(on.pass_time(1.0))
        (a, first), (b, last) = hellos[0], hellos[-1]
        rates.append((last.uptime_us - first.uptime_us) / (1e6 * (b - a)) - 1)
        starts.append(1e-6 * first.uptime_us)
    assert np.abs(rates).max() < 22e-6
    assert np.std(rates) == pytest.approx(20e-6 / np.sqrt(3), rel=0.3)
    assert np.ptp(starts) > 400.0


def test_what_was_measured_out_of_session_is_not_told_in_it(desk):
    on = desk(imu=ImuParams())
    on.pass_time(0.1)
    for count in range(100):
        on.unit.take_imu(ImuSample(0, on.now, np.full(6, count)))
    on.open()
    on.unit.take_imu(ImuSample(0, on.now, np.full(6, 100)))
    first = on.samples(on.pass_time(0.05))[0]
    assert (first.imu_index, first.imu_count) == (100, 1)


def test_samples_that_its_imu_did_not_take_count_as_lost_and_parts_of_one_add_up(desk):
    on, told = desk(imu=ImuParams()).open(), []
    for step in [0.002] * 9 + [0.101] + [0.002] * 9 + [0.101]:  # a simulation that leaves time out: 49.5 samples, twice
        told += on.samples(on.pass_time(step))
        on.unit.take_imu(ImuSample(0, on.now, np.zeros(6, np.int64)))
    told += on.samples(on.pass_time(0.05))
    first, last = (sample for sample in told if sample.flags & Flag.IMU_LOST)
    assert first.imu_index in (9 + 49, 9 + 50)
    assert (last.imu_index, last.imu_count) == (18 + 99 + 1, 1)
