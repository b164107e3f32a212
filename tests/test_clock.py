"""The clock without waiting, and what it says of how its ticks were kept."""

import numpy as np
import pytest

from pretouch import loop
from pretouch.errors import ParameterError
from pretouch.loop import Durations, MonotonicClock


class FakeTime:
    """Stands in for the time module: sleeping only moves its hands, and wakes `late` [s] after what was asked."""

    def __init__(self) -> None:
        self.now, self.slept, self.cpu, self.late = 100.0, 0.0, 5.0, 0.0

    def monotonic(self) -> float:
        return self.now

    def thread_time(self) -> float:
        return self.cpu

    def sleep(self, duration: float) -> None:
        assert duration > 0
        self.now += duration + self.late
        self.slept += duration

    def work(self, wall: float, cpu: float = 0.0) -> None:
        self.now += wall
        self.cpu += cpu


@pytest.fixture
def fake_time(monkeypatch: pytest.MonkeyPatch) -> FakeTime:
    fake = FakeTime()
    monkeypatch.setattr(loop, "time", fake)
    return fake


@pytest.mark.parametrize(
    ("now", "ticks", "missed"),
    [
        (100.035, [100.035, 100.04, 100.05], 2),  # 100.01 and 100.02 went by unused, 100.03 is taken now
        (100.019, [100.019, 100.02], 0),
    ],
)
def test_a_late_caller_gets_one_tick_at_once_and_the_rest_are_counted(fake_time, now, ticks, missed):
    clock = MonotonicClock(0.01)
    clock.tick()  # at 100.00; the next ticks are 100.01, 100.02, ...
    fake_time.now = now
    assert clock.tick() == pytest.approx(ticks[0])
    assert fake_time.slept == 0.0
    assert (clock.missed, clock.overruns) == (missed, 1)
    # then in step again, without a burst
    assert [clock.tick() for _ in ticks[1:]] == pytest.approx(ticks[1:])
    assert (clock.missed, clock.overruns) == (missed, 1)


def test_time_between_making_a_clock_and_its_first_tick_is_not_missed(fake_time: FakeTime):
    clock = MonotonicClock(0.01)
    fake_time.work(3.0)
    assert clock.tick() == pytest.approx(103.0)
    assert clock.tick() == pytest.approx(103.01)
    assert clock.missed == 0
    assert clock.timing().cycles == 2


def test_ticks_do_not_drift_by_late_wake_ups(fake_time: FakeTime):
    clock = MonotonicClock(0.001)
    fake_time.late = 1e-4
    ticks = [clock.tick() for _ in range(1001)]
    assert ticks[-1] == pytest.approx(100.0 + 1.0 + 1e-4)
    assert clock.timing().wake_up.max == pytest.approx(1e-4)
    assert clock.timing().measured.median == pytest.approx(0.001, rel=0.01)


def test_ticks_come_at_their_period_and_slow_steps_are_counted_and_timed(fake_time: FakeTime):
    clock, ticks = MonotonicClock(0.001), []
    for i in range(1000):
        ticks.append(clock.tick())
        fake_time.work(0.0014 if i in (500, 700) else 0.0002, cpu=0.0001)
    ticks.append(clock.tick())
    np.testing.assert_allclose(np.diff(ticks[:500]), 0.001)
    timing = clock.timing()
    assert (timing.period, timing.cycles, timing.overruns, timing.missed) == (0.001, 1001, 2, 0)
    assert timing.busy.median == pytest.approx(0.0002, rel=0.01)
    assert timing.busy.p999 == pytest.approx(0.0014, rel=0.01)
    assert timing.busy.max == pytest.approx(0.0014)
    assert timing.cpu.max == pytest.approx(0.0001)
    # one period is longer by what its step took, the next shorter
    assert timing.measured.max == pytest.approx(0.0014)


def test_a_report_can_be_read(fake_time: FakeTime):
    clock = MonotonicClock(0.001)
    assert "0 cycles" in str(clock.timing())
    for _ in range(3):
        clock.tick()
        fake_time.work(0.0045)
    said = str(clock.timing())
    assert said.startswith("3 cycles at 1000 Hz: 2 overruns, 6 ticks missed.")
    busy = next(line for line in said.splitlines() if line.startswith("busy  "))
    # all but the largest are told within half a per cent
    np.testing.assert_allclose([float(word) for word in busy.split()[1:]], 4500, rtol=0.005)
    assert busy.split()[-1] == "4500"


def test_a_clock_of_the_machine_ticks_no_sooner_than_asked():
    clock = MonotonicClock(0.002)
    ticks = np.array([clock.tick() for _ in range(10)])
    # no tick before its time, however late the others were
    assert np.all(ticks - ticks[0] >= 0.002 * np.arange(10) - 1e-9)
    timing = clock.timing()
    assert timing.cycles == 10
    assert timing.measured.max >= timing.measured.median > 0


@pytest.mark.parametrize("period", [0.0, -0.01, np.nan, np.inf])
def test_a_period_that_is_none_is_refused(period: float):
    with pytest.raises(ParameterError, match="it must be greater than 0"):
        MonotonicClock(period)


@pytest.mark.parametrize("spread", [0.1, 1.0, 2.5])
def test_spreads_are_those_of_numpy(spread: float):
    values = np.random.default_rng(1).lognormal(np.log(2e-4), spread, 30_001)
    durations = Durations()
    for value in values:
        durations.add(value)
    found = durations.spread()
    expected = np.percentile(values, [50, 99, 99.9], method="inverted_cdf")
    np.testing.assert_allclose([found.median, found.p99, found.p999], expected, rtol=0.0051)
    assert found.max == values.max()
    assert durations.count == len(values)


def test_durations_however_odd_are_counted_in_the_same_memory_and_the_largest_is_told_as_it_is():
    durations = Durations()
    places = len(durations._counts)
    durations.add(3e-4)
    found = durations.spread()
    np.testing.assert_allclose([found.median, found.p99, found.p999, found.max], 3e-4, rtol=0.005)
    for value in (0.0, -1e-9, 1e-12, 1e-7, 1.0, 1e3, 1e6):
        durations.add(value)
    assert len(durations._counts) == places
    assert sum(durations._counts) == durations.count == 8
    assert durations.spread().max == 1e6
    assert durations.spread().p999 <= 1e6
