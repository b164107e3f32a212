"""When IMU samples were taken, against units of which that is known."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.calibration.stamps import ImuCounters, by_time, instants
from pretouch.traces import ImuTrace
from tests.examples import examples

NOMINAL = 416


@dataclass
class Heard:
    """What came of a unit: six arrays for `instants`, by name, and the true instants of the samples."""

    batches: dict[str, np.ndarray]
    true: np.ndarray
    batch: np.ndarray
    """Batch of each sample."""

    def only(self, kept) -> "Heard":
        """What is left of some batches, in the order given."""
        numbers = np.arange(len(self.batches["count"]))[kept]
        where = [np.flatnonzero(self.batch == b) for b in numbers]
        return Heard(
            {name: a[numbers] for name, a in self.batches.items()},
            np.concatenate([self.true[i] for i in where]),
            np.concatenate([np.full(len(i), k) for k, i in enumerate(where)]),
        )

    def error(self) -> np.ndarray:
        return instants(ImuCounters(**self.batches)) - self.true


def unit(
    rng, duration=30.0, rate=NOMINAL * 1.035, begin=1000.0, first=0, booted=-400.0, drift=50e-6, offset_error=3e-4,
    bound=2e-3, counted=None,
) -> Heard:  # fmt: skip
    """A unit as its firmware does: a FIFO read each 19 to 26 ms, ages of half a nominal period.

    `rate` is a number or what gives the instants of all samples; `counted` the numbers that the unit gives to them.
    """
    taken = rate if isinstance(rate, np.ndarray) else np.arange(rng.uniform(), duration * rate) / rate
    number = first + (np.arange(len(taken)) if counted is None else counted)
    read = np.cumsum(rng.uniform(0.019, 0.026, int(duration / 0.019)))
    read = read[(read > 0.1) & (read < taken[-1])]
    ends = np.searchsorted(taken, read)
    begins = np.append(np.searchsorted(taken, 0.08), ends[:-1])
    made = read + 0.0005
    own = (made - booted) * (1 + drift)
    batches = {
        "index": number[begins] % 2**32,
        "count": ends - begins,
        "time_us": np.floor(1e6 * own).astype(np.int64),
        "imu_age_us": np.full(len(read), 500 + 500_000 // NOMINAL),
        "offset": begin + made - own + rng.uniform(-offset_error, offset_error, len(read)),
        "bound": np.full(len(read), bound),
    }
    return Heard(batches, begin + taken[begins[0] : ends[-1]], np.repeat(np.arange(len(read)), ends - begins))


def lossy(rng, heard: Heard, loss=0.3) -> Heard:
    return heard.only(rng.random(len(heard.batches["count"])) >= loss)


def joined(*parts: Heard) -> Heard:
    names = parts[0].batches
    before = np.cumsum([0, *(len(p.batches["count"]) for p in parts[:-1])])
    return Heard(
        {name: np.concatenate([p.batches[name] for p in parts]) for name in names},
        np.concatenate([p.true for p in parts]),
        np.concatenate([p.batch + b for p, b in zip(parts, before, strict=True)]),
    )


@given(
    st.integers(0, 2**31), st.floats(0.96, 1.04), st.floats(-50e-6, 50e-6), st.floats(0.0, 0.5),
    st.integers(0, 2**32 - 1), st.floats(-3e5, -1.0),
)  # fmt: skip
@examples(30, least=10)
def test_instants_are_true_to_a_tenth_of_a_period_whatever_is_lost(seed, rate, drift, loss, first, booted):
    rng = np.random.default_rng(seed)
    heard = lossy(rng, unit(rng, 20.0, NOMINAL * rate, first=first, drift=drift, booted=booted), loss)
    found = instants(ImuCounters(**heard.batches))
    error = found - heard.true
    assert np.abs(error).max() < 3e-4
    assert error.std() < 1.2e-4


def wrapping(rng) -> Heard:
    heard = unit(rng, first=2**32 - 5000)
    assert heard.batches["index"].min() < 5000 < 2**31 < heard.batches["index"].max()
    return heard


def warming_up(rng) -> Heard:
    """Its rate changes by 0.1 % in half a minute."""
    even = np.arange(0.001, 90.0, 1 / (NOMINAL * 1.02))
    return lossy(rng, unit(rng, 90.0, even + 0.001 * 30 * (np.exp(-even / 30) - 1)))


def odd_ages(rng, share: float, late_us: float, waited: bool = False) -> Heard:
    """Some ages are off, or are those of samples that waited."""
    heard = unit(rng)
    late = np.where(rng.random(len(heard.batches["count"])) < share, late_us, 0)
    heard.batches["imu_age_us"] = heard.batches["imu_age_us"] + np.round((1.035 if waited else 1.0) * late).astype(int)
    heard.batches["time_us"] = heard.batches["time_us"] + late.astype(int) * waited
    return heard


def silent_for_a_minute(rng) -> Heard:
    heard = unit(rng, 100.0)
    sent = heard.batches["time_us"] * 1e-6 - 400.0
    return heard.only((sent < 20.0) | (sent > 80.0))


def loosely_bound_at_first(rng) -> Heard:
    """Its clock is heard for seconds only."""
    heard = unit(rng, 4.0, drift=20e-6, offset_error=0.0)
    for name in ("offset", "bound"):
        heard.batches[name][:120] += np.linspace(0.004, 0.001, 120)
    return heard


@pytest.mark.parametrize(
    ("made", "largest"),
    [
        (wrapping, 3e-4),
        # it boots half way, or its clock jumps: two clocks
        (lambda rng: joined(unit(rng), unit(rng, begin=1033.0, booted=0.0)), 3e-4),
        (lambda rng: joined(unit(rng, 15.0), unit(rng, 15.0, begin=1015.5, booted=-415.52, first=9000)), 3e-4),
        (warming_up, 4e-4),
        (lambda rng: odd_ages(rng, 0.05, 30_000), 3e-4),
        (lambda rng: odd_ages(rng, 0.5, 60_000, waited=True), 4e-4),
        (silent_for_a_minute, 4e-4),
        (loosely_bound_at_first, 4e-4),
    ],
)
def test_instants_are_true_whatever_a_clock_and_a_network_do(made, largest):
    assert np.abs(made(np.random.default_rng(4)).error()).max() < largest


@pytest.mark.parametrize("loss", [0.0, 0.5])
@pytest.mark.parametrize("wrong", [-37, -2, 3, 40])
def test_samples_that_a_unit_lost_and_miscounted_are_counted_by_its_clock(wrong, loss):
    rng, rate = np.random.default_rng(8), NOMINAL * 1.03
    taken = np.arange(0.001, 30.0, 1 / rate)
    taken = taken[(taken < 11.0) | (taken > 13.0)]
    counted = np.round(taken * rate).astype(np.int64) + wrong * (taken > 12.0)
    heard = lossy(rng, unit(rng, 30.0, taken, counted=counted), loss)
    away = np.abs(heard.true - 1012.0) > 1.1  # a batch with samples of both sides cannot be parted
    assert np.abs(heard.error())[away].max() < 5e-4


def test_what_is_not_known_is_nan_and_left_out_when_put_in_order():
    rng = np.random.default_rng(12)
    heard = unit(rng)
    heard.batches["offset"][:100] = np.nan
    found = instants(ImuCounters(**heard.batches))
    np.testing.assert_array_equal(np.isnan(found), heard.batch < 100)
    values = rng.normal(size=(len(heard.true), 3))
    trace = by_time(ImuTrace(found, values, -values))
    np.testing.assert_array_equal(trace.acceleration, values[heard.batch >= 100])
    np.testing.assert_array_equal(trace.angular_velocity, -values[heard.batch >= 100])
    assert np.all(np.diff(trace.stamp) > 0)


@pytest.mark.parametrize("batches", [0, 1, 5, 20])
def test_too_little_to_tell_a_rate_is_not_known(batches):
    heard = unit(np.random.default_rng(13))
    found = instants(ImuCounters(**{name: a[:batches] for name, a in heard.batches.items()}))
    assert len(found) == heard.batches["count"][:batches].sum()
    assert np.isnan(found).all()


@given(st.integers(0, 2**31), st.integers(2, 60))
@examples(200)
def test_junk_gives_an_array_of_the_right_length_and_no_warning(seed, batches):
    rng = np.random.default_rng(seed)
    count = rng.integers(0, 33, batches)
    index, time = (rng.integers(0, rng.choice([2, 1000, 10**7, 2**32]), batches) for _ in range(2))
    age = rng.integers(0, rng.choice([1, 10**4, 2**32]), batches)
    offset = rng.choice([np.nan, 0.0, 5.0, np.inf], batches, p=[0.05, 0.8, 0.1, 0.05])
    bound = rng.choice([0.0, 1e-3, 1e9, np.inf], batches)
    assert instants(ImuCounters(index, count, time, age, offset, bound)).shape == (count.sum(),)
