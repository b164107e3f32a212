from itertools import groupby

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.units.channel import Channel, ChannelParams, NetworkParams, network


def course(params: ChannelParams, count: int = 20_000, seed: int = 0) -> tuple[np.ndarray, list[int]]:
    """Arrival times (M,) [s] of datagrams sent 20 ms apart, and their numbers in the order of arrival."""
    channel, times, numbers = Channel[int](params, np.random.default_rng(seed)), [], []
    for ms in range(20 * count + 2000):
        if ms % 20 == 0 and ms < 20 * count:
            channel.put(ms // 20, 1e-3 * ms)
        for number in channel.take(1e-3 * ms):
            times.append(1e-3 * ms - 0.02 * number)
            numbers.append(number)
    return np.array(times), numbers


def runs(numbers: list[int], count: int) -> list[int]:
    """Lengths of the runs of datagrams that never arrived."""
    came = set(numbers)
    return [len(list(run)) for lost, run in groupby(i not in came for i in range(count)) if lost]


def test_by_default_all_arrive_late_by_the_least_delay_and_an_exponential_jitter():
    delay, numbers = course(ChannelParams())
    assert sorted(numbers) == list(range(20_000))
    assert delay.min() >= 0.008
    assert delay.mean() == pytest.approx(0.008 + 0.004 + 0.0005, abs=2e-4)  # looked at each millisecond
    assert delay.std() == pytest.approx(0.004, rel=0.05)


def test_the_way_down_is_shorter_and_its_jitter_narrower():
    delay, _ = course(NetworkParams().down)
    assert delay.mean() == pytest.approx(0.0012 + 0.0012 + 0.0005, abs=1e-4)
    assert np.percentile(delay, 99) < 0.007


@pytest.mark.parametrize(
    ("loss", "loss_run", "count", "mean"),
    [(0.1, 0.0, 20_000, 1 / 0.9), (0.3, 0.0, 20_000, 1 / 0.7), (0.1, 5.0, 40_000, 5.0)],
)
def test_losses_are_of_the_size_asked_for_and_independent_or_in_runs_of_the_mean_asked_for(loss, loss_run, count, mean):
    _, numbers = course(ChannelParams(loss=loss, loss_run=loss_run), count=count)
    assert 1 - len(numbers) / count == pytest.approx(loss, abs=0.015 if loss_run else 0.01)
    assert np.mean(runs(numbers, count)) == pytest.approx(mean, rel=0.1 if loss_run else 0.05)


def test_a_datagram_held_up_is_overtaken_and_one_is_doubled_as_often_as_asked_for():
    _, in_order = course(ChannelParams(jitter_s=0.0), count=2000)
    assert in_order == sorted(in_order)
    _, numbers = course(ChannelParams(jitter_s=0.0, overtaken=0.1), count=2000)
    overtaken = sum(
        number < newest for number, newest in zip(numbers[1:], np.maximum.accumulate(numbers), strict=False)
    )
    assert overtaken == pytest.approx(200, abs=40)
    assert sorted(numbers) == in_order
    _, numbers = course(ChannelParams(doubled=0.2), count=5000)
    assert len(numbers) - len(set(numbers)) == pytest.approx(1000, abs=100)


def test_a_seed_decides_the_course():
    lossy = network(loss=0.2, overtaken=0.1, doubled=0.1).up
    (a, x), (b, y), (_, z) = course(lossy, 500), course(lossy, 500), course(lossy, 500, seed=1)
    assert x == y
    assert np.array_equal(a, b)
    assert x != z


def test_all_or_nothing_can_be_lost():
    assert course(ChannelParams(loss=1.0), 50)[1] == []
    assert course(ChannelParams(loss=1.0, loss_run=3.0), 50)[1] == []
    assert len(course(ChannelParams(loss_run=3.0), 50)[1]) == 50


def test_a_network_is_lossy_both_ways_and_its_jitter_is_that_of_the_way_up():
    made = network(loss=0.1, jitter=0.02, overtaken=0.05, doubled=0.01)
    assert (made.up.loss, made.up.jitter_s, made.up.overtaken, made.up.doubled) == (0.1, 0.02, 0.05, 0.01)
    assert (made.down.loss, made.down.jitter_s, made.down.overtaken, made.down.doubled) == (0.1, 0.0012, 0.05, 0.01)
    assert network() == NetworkParams()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"loss": 1.5}, "ChannelParams.loss is 1.5"),
        ({"loss": 0.1, "loss_run": 0.5}, "it must be 0, or at least 1"),
        ({"loss": 0.9, "loss_run": 2.0}, "give at least 9"),
        ({"delay_s": -0.1}, "ChannelParams.delay_s"),
    ],
)
def test_a_network_that_cannot_be_is_refused(given, said):
    with pytest.raises(ParameterError, match=said):
        ChannelParams(**given)
