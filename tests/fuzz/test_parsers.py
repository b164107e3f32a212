"""No damaged file and no message is worse than a sentence, soon: what is whole is changed at random."""

import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from pretouch.contact.residual_model import residual_init
from pretouch.errors import PretouchError
from pretouch.imported_data.log import Choice, Log
from pretouch.imported_data.reading import open_log, read_force
from pretouch.imported_data.torques import torque_recording
from pretouch.importing.chain import arm_of
from pretouch.importing.read import read_robot
from pretouch.params import SequentialParams
from pretouch.profiles import profile
from pretouch.robot.description import description_text, load_description, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin, paper_skin, skin_file
from pretouch.session.memory import load_learnt, save_learnt
from pretouch.types import RangeStatus
from pretouch.units.keys import load_keys, save_keys
from pretouch.units.skin_recording import SkinRecording, read_skin
from pretouch.units.wire import TAG_SIZE
from tests.following_arm import controller_of
from tests.fuzz.mutations import Change, changed, changes
from tests.imported_data.files import STORE1, pushed, wrenches, write_bag1, write_csv
from tests.imported_data.joint_files import Moving
from tests.importing.made import six_axis
from tests.recording.runs import read_whole, recorded_run
from tests.units.fake_unit import KEYS, Bench
from tests.units.test_skin_recording import record

SOON_S = 10.0
"""Longest time for anything that is read [s]."""
MEMORY = 400_000_000
"""Largest memory that Python and NumPy may take for it [B]."""
NAMES = (
    "recording", "recording of units", "CSV of forces", "CSV of torques", "ROS bag", "URDF", "skin", "keys",
    "learnt", "description", "profile", "wire",
)  # fmt: skip


# Everything that reads files and messages

Read = Callable[[bytes], object]


@dataclass(frozen=True)
class Parser:
    """One that reads."""

    corpus: list[bytes]
    """What is changed: something whole first; of messages, then what once did harm."""
    read: Read
    words: tuple[bytes, ...] = (b"\n", b"[[", b"]]", b"=", b"'", b'"""', b"{", b"}", b",", b";", b"inf", b"nan", b"a.b")


def _of_file(folder: Path, name: str, read: Callable[[Path], object], *corpus: bytes, **more: Any) -> Parser:
    """Write bytes to a file and have it read."""

    def written(data: bytes) -> object:
        (folder / name).write_bytes(data)
        return read(folder / name)

    return Parser(list(corpus), written, **more)


@contextmanager
def parsers(folder: Path) -> Iterator[dict[str, Parser]]:
    """Have all of them, with their files in a folder."""
    model = RobotModel(panda())
    recorded_run(folder / "whole.mcap", controller_of(model, paper_skin(model)), 8)
    found = {
        "recording": _of_file(folder, "a.mcap", read_whole, (folder / "whole.mcap").read_bytes()),
        "recording of units": _of_file(folder, "b.mcap", read_skin, _units_recorded(folder / "units.mcap")),
        **_of_tables(folder, model),
        "URDF": _of_file(folder, "arm.urdf", lambda p: arm_of(read_robot(p)), six_axis().encode(), words=TAGS),
        **_of_tomls(folder, model),
        "profile": Parser(
            [b"pretouch:detect.memory_s=100:react.reach_m=0.2"], lambda data: profile(data.decode(errors="replace"))
        ),
    }
    with Bench() as bench:
        bench.join()
        yield found | {"wire": _of_units(bench)}


TAGS = tuple(f"<{tag}>".encode() for tag in ("link", "joint", "geometry", "mesh", "/a"))
_HUGE = b"1" + 400 * b"0"
"""A whole number that no float holds."""


def _units_recorded(place: Path) -> bytes:
    with SkinRecording(place) as recording:
        for number in range(10):
            record(recording, number)
    return place.read_bytes()


# tables and bags


def _read_force(place: Path) -> None:
    log = open_log(place, Choice())
    assert_sound(log.force(posture=False).in_order("force"), "force")
    read_force(log, Choice())


def assert_sound(log: Log, what: str) -> None:
    """What was read is numbers at instants that increase."""
    assert np.isfinite(log.arrays[what]).all()
    assert np.all(np.diff(log.time) > 0)


def _of_tables(folder: Path, model: RobotModel) -> dict[str, Parser]:
    force = pushed(2.0, ())
    columns = {"time_s": np.arange(len(force)) / 100.0} | {f"force_{a}_N": force[:, i] for i, a in enumerate("xyz")}
    torques = Moving(model, 0.3).external_csv(folder / "torques.csv").read_bytes()
    late = torques.split(b"\n")[0] + b"\n"  # and a time that no 64 bits hold in nanoseconds
    bag = write_bag1(folder / "whole.bag", wrenches(force[:20], store=STORE1)).read_bytes()

    def read_torques(place: Path) -> None:
        log = open_log(place, Choice())
        assert_sound(log.positions().in_order("q"), "q")
        torque_recording(log.torques(), Choice())

    return {
        "CSV of forces": _of_file(folder, "a.csv", _read_force, write_csv(folder / "f.csv", columns).read_bytes()),
        "CSV of torques": _of_file(folder, "b.csv", read_torques, torques, late + b"9223372037.0" + 28 * b",0"),
        "ROS bag": _of_file(folder, "a.bag", _read_force, bag),
    }


# TOML


def _of_tomls(folder: Path, model: RobotModel) -> dict[str, Parser]:
    save_keys(KEYS, folder / "keys.toml")
    read_learnt = partial(load_learnt, arm=model, p=SequentialParams())
    save_learnt(folder / "learnt.toml", model, residual_init(model.n, SequentialParams()), "panda", 1.0)

    def keys(place: Path) -> object:
        place.chmod(0o600)
        return load_keys(place)

    (folder / "described").mkdir()
    (folder / "described" / panda().mjcf.name).write_bytes(panda().mjcf.read_bytes())
    described = description_text(panda()).encode()
    return {
        "skin": _of_file(folder, "s.toml", partial(load_skin, model=model), skin_file(panda()).read_bytes()),
        "keys": _of_file(folder, "k.toml", keys, (folder / "keys.toml").read_bytes()),
        "learnt": _of_file(folder, "l.toml", read_learnt, (folder / "learnt.toml").read_bytes()),
        "description": _of_file(folder / "described", "robot.toml", load_description, described),
    }


# messages


def _of_units(bench: Bench) -> Parser:
    """A stolen unit: what it says is signed with its key."""
    unit = bench.units[0]
    sample, hello = unit.sample(bench.now), unit.hello(bench.now)

    def read(data: bytes) -> None:
        bench.now, data = bench.now + 0.001, data[:2000]
        bench.send(data + unit.mac.tag(data), data + unit.session.tag(data))
        readings = bench.receiver.readings()
        valid = readings.status == RangeStatus.OK
        assert np.all(np.isfinite(readings.distance[valid]))
        assert np.all(readings.distance[valid] >= 0.0)
        assert np.all(readings.stamp <= bench.now)
        bench.answers()

    return Parser([sample[:-TAG_SIZE], hello[:-TAG_SIZE]], read)


# The tests


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Parser]]:
    with parsers(tmp_path_factory.mktemp("parsers")) as found:
        assert set(found) == set(NAMES)
        yield found


def read(parser: Parser, data: bytes) -> bool:
    """Have it read; return whether it was refused."""
    try:
        parser.read(data)
        sentence = ""
    except PretouchError as refused:
        sentence = str(refused) or type(refused).__name__
    assert len(sentence) < 2000 + len(data)
    return bool(sentence)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_whole_is_read_and_what_once_did_harm_does_none(there: dict[str, Parser], name: str) -> None:
    parser = there[name]
    assert not read(parser, parser.corpus[0])
    for data in parser.corpus[1:]:
        tracemalloc.start()
        began = time.monotonic()
        read(parser, data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < MEMORY
        assert time.monotonic() - began < SOON_S


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_whatever_is_changed_is_no_worse_than_a_sentence(there: dict[str, Parser], name: str) -> None:
    parser = there[name]

    @settings(max_examples=200, deadline=1e3 * SOON_S, suppress_health_check=list(HealthCheck))
    @given(changes, changes)
    def fuzzed(first: list[Change], second: list[Change]) -> None:
        data = parser.corpus[second[0].number % len(parser.corpus)]
        read(parser, changed(data, first, (*parser.words, parser.corpus[0][:200])))

    fuzzed()
