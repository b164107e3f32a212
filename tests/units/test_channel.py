import numpy as np
import pytest

from pretouch.units.fleet import Channel, ChannelParams, NetworkParams


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


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3, 1.0])
def test_losses_are_of_the_size_asked_for(loss):
    assert 1 - len(course(ChannelParams(loss=loss))[1]) / 20_000 == pytest.approx(loss, abs=0.01)


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
