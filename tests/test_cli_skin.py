"""`pretouch skin`: units watched, recorded, simulated, and given keys."""

import json
import re
import resource
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from pretouch import cli
from pretouch.cli import skin_monitor
from pretouch.cli.skin_monitor import only_here
from pretouch.types import RangeStatus
from pretouch.units import EVERYWHERE
from pretouch.units.keys import Keys, UnitKey, load_keys, new_key, save_keys
from pretouch.units.skin_recording import SkinRecording, read_skin
from pretouch.units.wire import Flag
from tests.ports import free_port
from tests.units.desk import Desk

ROOT = Path(__file__).parents[1]


@pytest.fixture
def keys(tmp_path):
    made = Keys([UnitKey("wrist", 1, new_key()), UnitKey("hand-1", 2, new_key())])
    save_keys(made, tmp_path / "keys.toml")
    return made


@pytest.fixture
def port():
    return free_port()


def monitor(tmp_path, port, *more):
    return cli.main(["skin", "monitor", "--keys", str(tmp_path / "keys.toml"), "--port", str(port), *more])


@pytest.mark.slow
def test_units_that_are_well_are_shown_recorded_and_written_as_numbers(keys, port, tmp_path, capsys):
    place, numbers = tmp_path / "units.mcap", tmp_path / "health.json"
    with Desk(keys, port):
        code = monitor(tmp_path, port, "--duration", "3", "--record", str(place), "--json", str(numbers))
    said = capsys.readouterr().out
    assert code == 0, said
    assert "2 of 2 units live" in said
    assert "hand-1" in said
    assert "units.mcap holds" in said
    told = json.loads(numbers.read_text())
    assert [unit["unit"] for unit in told["units"]] == ["wrist", "hand-1"]
    assert not any(finding["level"] == "fault" for finding in told["findings"])
    for unit in told["units"]:
        assert unit["traffic"]["state"] == "live"
        assert unit["distance_m"] == pytest.approx(0.5, abs=0.02)
        assert unit["imu_rate_hz"] == pytest.approx(416, rel=0.02)
    trace = read_skin(place)
    assert trace.complete
    for unit in trace.units.values():
        assert len(unit.samples) > 75
        fresh = [one for one in unit.samples if one.sample.flags & Flag.RANGE_NEW]
        assert all(one.sample.range_status == RangeStatus.OK for one in fresh)
        assert np.mean([one.stamp <= one.arrival for one in fresh]) > 0.9  # a clock is not known at once
        assert len(unit.imu.stamp) > 800
        assert np.allclose(np.median(unit.imu.acceleration, axis=0), [0, 0, 9.80665], atol=0.1)


@pytest.mark.slow
def test_units_that_are_stuck_or_go_silent_are_faults_and_the_exit_code_says_so(keys, port, tmp_path, capsys):
    with Desk(keys, port) as desk:
        desk.fleet.units[0].stuck = True
        timer = threading.Timer(1.5, lambda: setattr(desk.fleet.units[1], "silent", True))
        timer.start()
        code = monitor(tmp_path, port, "--duration", "3")
        timer.join()
    said = capsys.readouterr().out
    assert code == 1
    assert re.search(r"fault: hand-1 has sent nothing for \d\.\d s \(limit 0\.3 s\)", said)
    assert "wrist has sent nothing" not in said
    assert "wrist repeats 0." in said
    assert "STUCK" in said


def test_where_nothing_is_heard_the_way_out_is_said(keys, port, tmp_path, capsys):
    assert monitor(tmp_path, port, "--duration", "0.3", "--units", "wrist") == 1
    said = capsys.readouterr().out
    assert "hand-1" not in said
    assert f"Nothing was received at 127.0.0.1:{port}, which only programs on this machine can reach" in said
    assert "--host 0.0.0.0" in said
    assert "wrist has sent nothing so far" in said


@pytest.mark.parametrize(
    ("host", "here"), [("::1", True), ("localhost", True), ("127.0.0.2", True), (EVERYWHERE, False), ("::", False)]
)
def test_an_address_of_this_machine_alone_is_told_from_others(host, here):
    assert only_here(host) == here


def test_units_with_other_keys_are_told_from_silent_ones(keys, port, tmp_path, capsys):
    others = Keys([UnitKey("wrist", 1, new_key()), UnitKey("hand-1", 2, new_key())])
    with Desk(others, port):
        assert monitor(tmp_path, port, "--duration", "1") == 1
    assert "with a wrong tag (another key, or a forgery)" in capsys.readouterr().out


def test_a_terminal_shows_a_table_that_changes(keys, port, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with Desk(keys, port):
        assert monitor(tmp_path, port, "--duration", "1.2") == 0
    said = capsys.readouterr().out
    assert said.count("latency") >= 4
    assert "\x1b[2K" in said
    assert "units live" not in said


@pytest.mark.slow
def test_a_disk_that_is_full_is_said_and_the_exit_code_tells_of_it(keys, port, tmp_path, capsys, monkeypatch):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def limited(place):  # after the receiver has its shared memory
        resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, before[1]))
        return SkinRecording(place)

    monkeypatch.setattr(skin_monitor, "SkinRecording", limited)
    try:
        with Desk(keys, port):
            code = monitor(tmp_path, port, "--duration", "3", "--record", str(tmp_path / "units.mcap"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert code == 1
    assert "free some space, then record again" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--duration", "-1"), "--duration is -1 s"),
        (("--duration", "nan"), "--duration is nan s"),
        (("--units", "elbow"), "There is no key for elbow"),
        (("--units", "wrist", "--skin", "x.toml"), "Both --skin and --units are given"),
        (("--skin", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("--host", ""), "The address to listen on is empty"),
        (("--host", "no.such.host.invalid"), "no.such.host.invalid"),
        (("--port", "70000"), "70000"),
        (("--record", "/nowhere/x.mcap"), "The folder /nowhere for the recording does not exist"),
        (("--json", "/dev/null/x.json"), "/dev/null/x.json cannot be written"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(keys, port, tmp_path, capsys, more, words):
    assert monitor(tmp_path, port, "--duration", "1", *more) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def started(*words, folder=ROOT):
    return subprocess.Popen(
        [sys.executable, "-u", "-m", "pretouch.cli", "skin", *map(str, words)], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_a_monitor_that_is_ended_leaves_its_recording(keys, port, tmp_path, number, code):
    place = tmp_path / "units.mcap"
    with Desk(keys, port) as desk:
        process = started("monitor", "--keys", tmp_path / "keys.toml", "--port", port, "--record", place)
        assert process.stdout
        assert any(line.startswith("2 s") for line in process.stdout)
        time.sleep(0.5)
        process.send_signal(number)
        sent = desk.fleet.units[0]._sequence
        out, err = process.communicate(timeout=20)
    assert process.returncode == code, err
    assert "Traceback" not in err
    trace = read_skin(place)
    assert trace.complete == (number != signal.SIGKILL)
    assert sent - trace.units["wrist"].samples[-1].sample.sequence <= 55
    assert out.count("units.mcap holds") == (number != signal.SIGKILL)


def test_keys_are_made_and_listed_without_being_shown(tmp_path, capsys):
    place = tmp_path / "keys.toml"
    assert cli.main(["skin", "keys", "--keys", str(place), "--new", "a, b"]) == 0
    assert stat.S_IMODE(place.stat().st_mode) == 0o600
    assert cli.main(["skin", "keys", "--keys", str(place), "--new", "c"]) == 0
    made = load_keys(place)
    assert [(unit.id, unit.number) for unit in made.values()] == [("a", 1), ("b", 2), ("c", 3)]
    said = capsys.readouterr().out
    assert "c: number 3, key " in said
    assert not any(unit.key.hex() in said for unit in made.values())
    assert cli.main(["skin", "keys", "--keys", str(place), "--new", "b"]) == 2
    assert "b already has a key" in capsys.readouterr().err
    assert cli.main(["skin", "keys", "--keys", str(tmp_path / "none.toml")]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_the_key_of_a_lost_unit_is_revoked_or_replaced_and_the_others_stay(tmp_path, capsys):
    place = tmp_path / "keys.toml"
    assert cli.main(["skin", "keys", "--keys", str(place), "--new", "a, b, c"]) == 0
    made = load_keys(place)
    assert cli.main(["skin", "keys", "--keys", str(place), "--revoke", "a"]) == 0
    assert "Revoked: a. A receiver that runs" in capsys.readouterr().out
    left = load_keys(place)
    assert dict(left) == {name: made[name] for name in "bc"}
    assert stat.S_IMODE(place.stat().st_mode) == 0o600
    assert cli.main(["skin", "keys", "--keys", str(place), "--revoke", "b", "--new", "b"]) == 0
    anew = load_keys(place)
    assert anew["c"] == made["c"]
    assert anew["b"].key != made["b"].key
    capsys.readouterr()
    assert cli.main(["skin", "keys", "--keys", str(place), "--revoke", "b, z"]) == 2
    assert "z has no key to revoke: give names of c, b." in capsys.readouterr().err
    assert load_keys(place) == anew


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--port", "0"), "The receiver's port is 0"),
        (("--stuck", "elbow"), "Unknown unit elbow: choose from hand_left"),
        (("--skin", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("--duration", "-2"), "-2"),
        (("--seed", "-1"), "--seed is -1"),
        (("--host", ""), "The receiver's address is empty"),
    ],
)
def test_a_simulation_that_makes_no_sense_is_refused(tmp_path, capsys, more, words):
    assert cli.main(["skin", "simulate", "--keys", str(tmp_path / "keys.toml"), *more]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.slow
def test_simulated_units_are_heard_by_the_monitor_with_the_keys_that_were_made(tmp_path, port, capsys):
    place = tmp_path / "keys.toml"
    simulation = started("simulate", "--keys", place, "--port", port, "--silenced", "hand_left", "--loss", "0.2")
    try:
        assert simulation.stdout
        assert "Made keys for 7 units" in simulation.stdout.readline()
        simulation.stdout.readline()
        assert monitor(tmp_path, port, "--duration", "6") == 1
    finally:
        simulation.send_signal(signal.SIGINT)
        _, err = simulation.communicate(timeout=20)
    assert simulation.returncode == 130
    assert "Traceback" not in err
    said = capsys.readouterr().out
    assert "6 of 7 units live" in said
    assert "fault: hand_left has sent nothing so far" in said
    assert "of its samples in transmission (limit 15%)" in said
