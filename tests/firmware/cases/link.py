"""The unit's side of a session."""

from clock import Clock
from fake_bus import Clock as FakeClock
from fake_receiver import Draw, FakeReceiver, steps
from link import Link
from wire import Sample

KEY = bytes(range(32))


def _link(start_us=0):
    fake = FakeClock(start_us)
    clock = Clock(fake)
    receiver = FakeReceiver(7, KEY)
    return fake, clock, receiver, Link(7, KEY, receiver, clock, Draw(), 0x0001, 1)


def _live(start_us=0):
    fake, clock, receiver, link = _link(start_us)
    link.step(clock.ticks())
    receiver.open()
    link.step(clock.ticks())
    assert link.live
    return fake, clock, receiver, link


def _pass(fake, clock, link, us, step=1000):
    for _ in range(us // step):
        fake.advance(step)
        link.step(clock.ticks())


def hellos_come_every_75_to_125_ms_with_one_challenge():
    fake, clock, receiver, link = _link()
    _pass(fake, clock, link, 3_000_000)
    times = [hello[2] for hello in receiver.hellos]
    gaps = steps(times)
    assert 75_000 <= min(gaps) <= max(gaps) <= 126_000, gaps
    assert max(gaps) - min(gaps) > 5_000, "they are spread"
    assert len({hello[3] for hello in receiver.hellos}) == 1
    assert receiver.hellos[0][:2] == (1, 1)


def samples_count_from_1_and_echo_the_beacon():
    fake, clock, receiver, link = _live()
    sample = Sample(7)
    link.send(sample, clock.ticks())
    fake.advance(300_000)
    link.send(sample, clock.ticks())
    receiver.go_on()
    link.step(clock.ticks())
    fake.advance(5_000)
    link.send(sample, clock.ticks())
    told = [(s["sequence"], s["time_us"], s["beacon"], s["hold"]) for s in receiver.samples]
    assert told == [(1, 0, 1, 0), (2, 300_000, 1, 300_000), (3, 305_000, 2, 5_000)], told


def a_session_ends_2_s_after_the_last_beacon_and_the_next_has_another_challenge():
    fake, clock, receiver, link = _live()
    _pass(fake, clock, link, 1_500_000)
    receiver.go_on()
    _pass(fake, clock, link, 2_000_000)
    assert link.live
    _pass(fake, clock, link, 2_000)
    assert not link.live
    assert len(receiver.hellos) == 2
    assert receiver.hellos[0][3] != receiver.hellos[1][3]
    receiver.open(b"nonce..2")
    link.step(clock.ticks())
    link.send(Sample(7), clock.ticks())
    assert [s["sequence"] for s in receiver.samples] == [1]


def a_session_ends_with_its_last_sequence_number():
    _, clock, receiver, link = _live()
    link._sequence = 0xFFFFFFFE
    link.send(Sample(7), clock.ticks())
    link.step(clock.ticks())
    assert not link.live
    assert len(receiver.hellos) == 2
    assert receiver.hellos[0][3] != receiver.hellos[1][3]


def old_beacons_and_those_of_another_nonce_do_not_keep_a_session_open():
    fake, clock, receiver, link = _live()
    receiver.go_on()
    link.step(clock.ticks())
    for number in range(3, 24):
        for told, nonce in ((1, receiver.nonce), (2, receiver.nonce), (number, b"another!")):
            receiver.inbox.append(receiver.beacon(told, nonce, receiver.challenge))
        _pass(fake, clock, link, 100_000, 10_000)
    assert not link.live


def beacons_of_the_session_before_open_nothing():
    fake, clock, receiver, link = _live()
    _pass(fake, clock, link, 2_100_000)
    assert not link.live
    for number in (1, 2, 1000):
        receiver.inbox.append(receiver.beacon(number, receiver.nonce, receiver.hellos[0][3]))
    _pass(fake, clock, link, 100_000)
    assert not link.live


def what_is_no_beacon_opens_nothing_and_a_flood_of_it_holds_a_pass_up_for_four_datagrams_at_most():
    _, clock, receiver, link = _link()
    link.step(clock.ticks())
    good = receiver.beacon(1, b"nonce..1", receiver.challenge)
    wrong = [receiver.beacon(1, b"nonce..1", receiver.challenge, unit=8), good[:-1], good + b"\0", bytes(200)]
    wrong += [good[:-1] + bytes([good[-1] ^ 1])] + [bytes(36)] * 95
    receiver.inbox += wrong
    for left in range(96, -1, -4):
        link.step(clock.ticks())
        assert len(receiver.inbox) == left
    assert not link.live


def time_does_not_end_with_32_bits():
    fake, clock, receiver, link = _live()
    for _ in range(20):
        fake.advance(400_000_000)
        clock.us(clock.ticks())
    link.step(clock.ticks())
    receiver.open(b"nonce..2")
    link.step(clock.ticks())
    link.send(Sample(7), clock.ticks())
    assert receiver.samples[-1]["time_us"] == 8_000_000_000
