"""Values through shared memory come whole, in order, or not at all."""

import multiprocessing
import os
import signal
import time

import pytest

from pretouch.units.shared_memory import Mailbox, Ring

SPAWN = multiprocessing.get_context("spawn")


def value(number):
    return number.to_bytes(8, "little") * (1 + number % 500)


WRITER = """
number = 0
while True:
    number += 1
    place.write(number.to_bytes(8, "little") * (1 + number % 500))
    if number == 1000:
        started.set()
"""


@pytest.fixture(params=[Mailbox, lambda most: Ring(64, most)], ids=["mailbox", "ring"])
def written_to(request):
    place, started = request.param(8 * 500), SPAWN.Event()
    writer = SPAWN.Process(target=exec, args=(WRITER, {"place": place, "started": started}), daemon=True)
    writer.start()
    assert started.wait(30)
    yield place, writer
    writer.kill()
    writer.join()


def read_all(place):
    if isinstance(place, Ring):
        return place.take()
    number, found = place.read()
    assert found[:8] == number.to_bytes(8, "little")
    return [found]


def test_no_value_is_torn_and_none_goes_back(written_to):
    place, _ = written_to
    newest, end = 0, time.monotonic() + 30.0
    while newest < 20_000 and time.monotonic() < end:
        for found in read_all(place):
            number = int.from_bytes(found[:8], "little")
            assert found == value(number)
            assert number >= newest
            newest = number
    assert newest >= 20_000


def test_what_a_killed_writer_left_is_whole(written_to):
    place, writer = written_to
    os.kill(writer.pid, signal.SIGKILL)
    writer.join()
    for found in read_all(place):
        assert found == value(int.from_bytes(found[:8], "little"))


def test_a_mailbox_holds_the_newest():
    box = Mailbox(10)
    assert box.read() == (0, b"")
    assert [box.write(b"a"), box.write(b""), box.write(b"0123456789")] == [1, 2, 3]
    assert box.read() == box.read() == (3, b"0123456789")
    with pytest.raises(ValueError, match="11 bytes"):
        box.write(b"x" * 11)


@pytest.mark.parametrize("place", range(64, 100))
def test_a_value_of_which_one_byte_is_wrong_is_not_given(place):
    box = Mailbox(30)
    box.write(b"first")
    assert box.read() == (1, b"first")
    box.write(b"x" * 20)
    slot = box._offset(2)
    box._memory.bytes[slot + place - 64] ^= 1
    assert box.read() == (1, b"first")


def test_a_ring_gives_each_value_once_and_leaves_out_what_came_too_fast():
    ring = Ring(4, 10)
    assert ring.take() == []
    for k in range(3):
        ring.write(b"%d" % k)
    assert ring.take() == [b"0", b"1", b"2"]
    for k in range(3, 10):
        ring.write(b"%d" % k)
    assert ring.take() == [b"6", b"7", b"8", b"9"]
    assert ring.take() == []
    with pytest.raises(ValueError, match="11 bytes"):
        ring.write(b"x" * 11)
