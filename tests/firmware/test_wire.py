"""The unit's datagrams, what its drivers put into them, and its configuration, against the host's own code."""

import dataclasses
import json

import numpy as np

from pretouch.cli.skin_keys import Network, configuration
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB, STANDARD_GRAVITY
from pretouch.types import RangeStatus
from pretouch.units import wire
from pretouch.units.keys import UnitKey
from tests.firmware.harness import Run

KEY, CHALLENGE, NONCE = bytes(range(32)), b"challeng", b"nonce678"
SESSION = wire.session_mac(wire.Mac(KEY), CHALLENGE, NONCE)
START = f"""
import json, struct, wire
from binascii import hexlify, unhexlify
mac = wire.Mac({KEY!r})
session = wire.session_mac(mac, {CHALLENGE!r}, {NONCE!r})
"""
SAY_SAMPLES = """
for fields in json.load(open(FILE)):
    sample = wire.Sample(fields["unit"], 322)
    sample.zones = unhexlify(fields["zones"])
    for name in fields:
        if name not in ("unit", "imu", "touch", "zones"):
            setattr(sample, name, fields[name])
    imu = unhexlify(fields["imu"])
    sample.imu[:len(imu)] = imu
    if fields["touch"]:
        part = struct.unpack("<BBHII", unhexlify(fields["touch"]))
        sample.touch_contact, sample.touch_status, sample.touch_raw_mv = part[:3]
        sample.touch_force_mn, sample.touch_age_us = part[3:]
    print(hexlify(sample.seal(session)).decode())
"""
OPEN_BEACONS = f"""
for line in open(FILE):
    print(wire.open_beacon(unhexlify(line.strip()), 7, {CHALLENGE!r}, mac))
"""


def in_unit(run: Run, content: str, script: str) -> list[str]:
    start = f"{START}\nimport sys\nFILE = sys.path[0].rstrip('/') + '/given'\n"
    return run({"given": content}, start + script)


def samples() -> list[wire.Sample]:
    """Samples with random fields and with all fields at their least and most."""
    rng = np.random.default_rng(6)
    limits = {"H": (0, 2**16 - 1), "I": (0, 2**32 - 1), "Q": (0, 2**63 - 1), "B": (0, 255), "h": (-(2**15), 2**15 - 1)}
    bounds = [limits[code] for code in wire.SAMPLE.format[1:]]
    rows = [[low for low, _ in bounds], [high for _, high in bounds]]
    rows += [[int(rng.integers(low, high, endpoint=True)) for low, high in bounds] for _ in range(20)]
    made = []
    for row in rows:
        sample = wire.Sample(int(rng.integers(1, 65536)), *row)
        sample.imu_count = int(rng.integers(0, wire.IMU_MOST + 1))
        sample.imu = rng.bytes(sample.imu_count * wire.IMU_SAMPLE.size)
        if sample.flags & wire.Flag.TOUCH:
            sample.touch = rng.bytes(wire.TOUCH.size)
        if sample.flags & wire.Flag.ZONES:
            side = int(rng.integers(1, 9))
            sample.zones = bytes([side]) + rng.bytes(wire.zones_size(side) - 1)
        made.append(sample)
    return made


def test_samples_are_the_bytes_the_receiver_encodes(unit_python: Run) -> None:
    made = samples()
    content = json.dumps(
        [dataclasses.asdict(s) | {name: getattr(s, name).hex() for name in ("imu", "touch", "zones")} for s in made]
    )
    said = [bytes.fromhex(line) for line in in_unit(unit_python, content, SAY_SAMPLES)]
    assert said == [sample.encode(SESSION) for sample in made]
    assert [wire.decode_sample(datagram, SESSION) for datagram in said] == made


def test_a_hello_is_what_the_receiver_decodes(unit_python: Run) -> None:
    script = f"print(hexlify(wire.hello(7, 0x0102, 3, {CHALLENGE!r}, 1 << 40, mac)).decode())"
    (line,) = in_unit(unit_python, "", script)
    hello = wire.Hello(unit=7, firmware=0x0102, reset=wire.Reset.WATCHDOG, challenge=CHALLENGE, uptime_us=1 << 40)
    assert bytes.fromhex(line) == hello.encode(wire.Mac(KEY))
    assert wire.decode_hello(bytes.fromhex(line), wire.Mac(KEY)) == hello


def test_a_beacon_opens_only_whole_for_its_unit_challenge_and_key(unit_python: Run) -> None:
    beacon = wire.Beacon(unit=7, number=0xF1234567, nonce=NONCE)
    good = beacon.encode(wire.Mac(KEY), CHALLENGE)
    bad = [bytes(b ^ (1 << bit % 8) * (at == bit // 8) for at, b in enumerate(good)) for bit in range(8 * len(good))]
    bad += [good[:size] for size in range(1, len(good))] + [good + b"\0"]
    bad += [dataclasses.replace(beacon, unit=8).encode(wire.Mac(KEY), CHALLENGE)]
    bad += [beacon.encode(wire.Mac(KEY), b"another1"), beacon.encode(wire.Mac(bytes(32)), CHALLENGE)]
    lines = in_unit(unit_python, "\n".join(each.hex() for each in [good, *bad]), OPEN_BEACONS)
    assert lines == [str((0xF1234567, NONCE))] + ["None"] * len(bad)


def test_keys_of_any_length_up_to_a_block_make_the_same_mac(unit_python: Run) -> None:
    keys = [bytes(range(200, 200 - length, -1)) for length in (1, 31, 32, 63, 64)]
    script = f"for key in {keys!r}: print(hexlify(wire.Mac(key).whole(b'one', b'', b'two')).decode())"
    assert in_unit(unit_python, "", script) == [wire.Mac(key).whole(b"onetwo").hex() for key in keys]


def test_bytes_of_version_1_stay_as_they_are(unit_python: Run) -> None:
    (line,) = in_unit(unit_python, "", "print(hexlify(wire.Sample(7).seal(session)).decode())")
    assert line == (
        "505401030700"
        + "00" * 24
        + "0080"
        + "0000"
        + "00ff0000ffffffff"
        + "00" * 16
        + "ffffffff"
        + "4275fe96ca4f2d30cf0af69bdf050af6"
    )


def test_the_wire_reads_the_samples_of_the_imu_and_their_scales(unit_python: Run) -> None:
    """The sensor at rest, z up, turning at 100 degrees a second about x; counts by the data sheet's sensitivities."""
    script = """
from fake_bus import driven
from fake_lsm6ds3 import FakeLsm6ds3
from lsm6ds3 import LSM6DS3

clock, bus, device, sensor = driven(LSM6DS3, FakeLsm6ds3)
device.sample = lambda k: (5714, 0, 0, 0, 0, 8197)
sensor.begin()
clock.advance(20_000)
buffer = memoryview(bytearray(120))
count = sensor.drain(buffer, 10)
print(sensor.scale_code, bytes(buffer[: 12 * count]).hex(), bytes(device.read(0x10, 2)).hex())
"""
    ((code, data, registers),) = (line.split() for line in unit_python({}, script))
    assert registers == "6864"  # 416 Hz and 4 g; 416 Hz and 500 dps
    acceleration, turn = wire.imu_values(bytes.fromhex(data), int(code))
    np.testing.assert_allclose(acceleration, [[0, 0, STANDARD_GRAVITY]] * 8, atol=ACCELERATION_LSB[4])
    np.testing.assert_allclose(turn, [[np.deg2rad(100), 0, 0]] * 8, atol=ANGULAR_RATE_LSB[500])


def test_each_status_a_driver_gives_is_one_the_controller_knows(unit_python: Run) -> None:
    printed = unit_python({}, "import vl53l1x, vl53l5cx\nprint(*vl53l1x._STATUS + vl53l5cx._STATUS_OF)")
    assert {int(code) for code in printed[0].split()} | {2, 14} <= set(RangeStatus)


SHOW = """
import os, sys
os.chdir(sys.path[0])
import config
read = config.load()
for text in (read.ssid, read.password, read.host): print(text.encode())
print(read.unit, read.port, read.key == bytes(range(32)), read.zones, read.sensor)
"""


def test_a_unit_reads_what_the_host_writes_with_characters_beyond_16_bits(unit_python: Run) -> None:
    name, password = 'caf\u00e9 "x" \U0001f600', "\U0001f600" * 2
    network = Network(name, "10.0.0.1", 4950, sensor="vl53l7cx", zones=8)
    text = configuration(UnitKey("left", 7, bytes(range(32))), network, password)
    lines = unit_python({"config.json": text}, SHOW)
    assert lines == [str(name.encode()), str(password.encode()), "b'10.0.0.1'", "7 4950 True 8 vl53l7cx"]
