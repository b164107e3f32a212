"""The receiver in a process of its own: values come over, and every way to end leaves nothing behind."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from pretouch.errors import HardwareError
from pretouch.units.skin import NetworkSkin
from tests.units.fake_unit import IDS, KEYS, FakeUnit

SHARED = Path("/dev/shm")  # noqa: S108  where named shared memory would lie
PROGRAM = """
import multiprocessing, sys, time
sys.path.insert(0, {tests!r})
from pretouch.errors import HardwareError
from pretouch.units.skin import NetworkSkin
from tests.units.fake_unit import IDS, KEYS

def start():
    try:
        skin = NetworkSkin(IDS, KEYS)
        print(skin.pid, flush=True)
        time.sleep(600)
    except HardwareError as error:
        print(error, flush=True)

if __name__ == "__main__":
    if "daemonic" in sys.argv:
        process = multiprocessing.get_context("spawn").Process(target=start, daemon=True)
        process.start()
        process.join()
    else:
        start()
"""


@pytest.fixture
def script(tmp_path):
    place = tmp_path / "program.py"
    place.write_text(PROGRAM.format(tests=str(Path(__file__).parents[2])))
    return str(place)


@pytest.fixture
def skin():
    with NetworkSkin(IDS, KEYS) as made:
        yield made


def until(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


def runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


class Player:
    """Units in real time."""

    def __init__(self, address):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(address)
        self.socket.setblocking(False)
        self.units = [FakeUnit(KEYS[id], time.monotonic() - 9.0) for id in IDS]

    def step(self):
        try:
            while True:
                datagram, now = self.socket.recv(2048), time.monotonic()
                for unit in self.units:
                    unit.hear(datagram, now)
        except (BlockingIOError, ConnectionRefusedError):
            pass
        for unit in self.units:
            now = time.monotonic()
            with suppress(ConnectionRefusedError):
                self.socket.send(unit.hello(now) if unit.session is None else unit.sample(now))

    def all_live(self, skin):
        self.step()
        time.sleep(0.02)
        return np.all(np.isfinite(skin.read().stamp)) and len(skin.traffic().units) == 2


@pytest.fixture
def player(skin):
    made = Player(skin.address)
    yield made
    made.socket.close()


def test_readings_samples_and_counts_come_over(skin, player):
    until(lambda: player.all_live(skin))
    until(lambda: player.all_live(skin) and skin.traffic().units[0].accepted > 10)
    now, readings = time.monotonic(), skin.read()
    assert np.all(readings.stamp < now)
    assert np.all((readings.distance >= 0.5) & (readings.distance < 0.507))
    samples = skin.take_samples()
    sequences = [one.sample.sequence for one in samples if one.unit == 0]
    assert len(sequences) > 10
    assert sequences == list(range(1, len(sequences) + 1))
    assert all(abs(one.offset - player.units[one.unit].offset) <= one.bound + 1e-5 for one in samples)
    assert all(one.sample.unit == KEYS[IDS[one.unit]].number for one in samples)
    assert all(one.sample.imu_count == 2 for one in samples)
    assert skin.take_samples() == []
    traffic = skin.traffic()
    assert traffic.units[1].state == "live"
    assert set(traffic.rejected.values()) == {0}
    assert traffic.unsent == 0


def test_a_killed_receiver_is_told_and_its_last_readings_grow_old(skin, player):
    until(lambda: player.all_live(skin))
    os.kill(skin.pid, signal.SIGKILL)
    until(lambda: not skin.alive)
    stamp = skin.read().stamp
    assert np.all(np.isfinite(stamp))
    player.step()
    np.testing.assert_array_equal(skin.read().stamp, stamp)
    assert skin.traffic().units[0].accepted >= 0
    skin.close()
    skin.close()
    np.testing.assert_array_equal(skin.read().stamp, stamp)


def test_a_taken_port_and_a_missing_key_are_told_at_the_start():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        port = holder.getsockname()[1]
        with pytest.raises(HardwareError, match=f"Port {port} of 127.0.0.1 is in use"):
            NetworkSkin(IDS, KEYS, port=port)
    with pytest.raises(HardwareError, match="no key for unit 9"):
        NetworkSkin(("unit 9",), KEYS)


@pytest.mark.parametrize("port", ["x", 70000, 1.5, True])
def test_what_is_no_port_is_told_before_anything_starts(port, monkeypatch):
    monkeypatch.setattr("pretouch.units.skin.get_context", None)
    with pytest.raises(HardwareError, match="is not valid"):
        NetworkSkin(IDS, KEYS, port=port)


def test_a_daemonic_process_is_told_that_it_may_start_none(script):
    command = [sys.executable, script, "daemonic"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "daemonic process" in done.stdout
    assert done.stderr == ""


def test_in_a_process_forked_off_closing_does_nothing(skin, monkeypatch):
    owner = os.getpid()
    with monkeypatch.context() as forked:
        forked.setattr(os, "getpid", lambda: owner + 1)
        skin.close()
        with pytest.raises(HardwareError, match=f"belongs to process {owner}"):
            _ = skin.alive
        assert skin.read().stamp.tolist() == [-np.inf] * 2
    assert skin.alive
    assert runs(skin.pid)


def test_ctrl_c_while_it_starts_leaves_no_process(monkeypatch):
    begun = []

    def interrupted(_):
        begun.extend(active_children())
        raise KeyboardInterrupt

    before = set(active_children())
    monkeypatch.setattr("pretouch.units.skin._wait_listening", interrupted)
    with pytest.raises(KeyboardInterrupt):
        NetworkSkin(IDS, KEYS)
    assert set(begun) - before
    assert set(active_children()) <= before


def test_the_receivers_process_does_not_heed_ctrl_c(skin, player):
    until(lambda: player.all_live(skin))
    for _ in range(3):
        os.kill(skin.pid, signal.SIGINT)
        accepted = skin.traffic().units[0].accepted
        until(lambda accepted=accepted: player.all_live(skin) and skin.traffic().units[0].accepted > accepted)
    assert skin.alive


@pytest.fixture
def program(script):
    before, pipe = set(SHARED.iterdir()), subprocess.PIPE
    parent = subprocess.Popen([sys.executable, script], stdout=pipe, stderr=pipe, text=True, start_new_session=True)
    child = int(parent.stdout.readline())
    yield parent, child
    parent.kill()
    with suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)
    parent.communicate(timeout=30)
    assert not [path for path in set(SHARED.iterdir()) - before if "pretouch" in path.name]


def test_it_ends_with_a_killed_parent(program):
    parent, child = program
    parent.kill()
    until(lambda: not runs(child))


def test_ctrl_c_reaches_the_parent_only_and_the_child_ends_without_a_word(program):
    parent, child = program
    os.killpg(parent.pid, signal.SIGINT)
    _, answer = parent.communicate(timeout=30)
    until(lambda: not runs(child))
    assert answer.count("KeyboardInterrupt") == 1
    assert answer.count("Traceback") == 1


def test_it_leaves_no_open_handles():
    handles = []
    for _ in range(2):
        with NetworkSkin(IDS, KEYS):
            pass
        handles.append(len(os.listdir("/proc/self/fd")))  # the tracker of multiprocessing stays from the first on
    assert handles[1] == handles[0]
