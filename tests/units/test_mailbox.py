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
    write(number.to_bytes(8, "little") * (1 + number % 500))
    if number == 1000:
        started.set()
"""


@pytest.fixture(params=["put", "write"], ids=["mailbox", "ring"])
def written_to(request):
    place = Mailbox(8 * 500 + 99, b"") if request.param == "put" else Ring(64, 8 * 500)
    started = SPAWN.Event()
    values = {"write": getattr(place, request.param), "started": started}
    writer = SPAWN.Process(target=exec, args=(WRITER, values), daemon=True)
    writer.start()
    assert started.wait(30)
    yield place, writer
    writer.kill()
    writer.join()


def read_all(place):
    return place.take() if isinstance(place, Ring) else [place.read()]


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
    box = Mailbox(40, "first")
    assert box.read() == "first"
    for value in (b"a", b"", [1.5, "b"]):
        box.put(value)
        assert box.read() == value
    assert box.read() is box.read()
    with pytest.raises(ValueError, match="does not fit into 40"):
        box.put(b"x" * 40)


@pytest.mark.parametrize("place", range(64, 115))
def test_a_value_of_which_one_byte_is_wrong_is_not_given(place):
    box = Mailbox(60, b"")
    box.put(b"first")
    assert box.read() == b"first"
    box.put(b"x" * 20)
    slot = box._offset(2)
    box._memory.bytes[slot + place - 64] ^= 1
    assert box.read() == b"first"


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
