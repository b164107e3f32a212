"""`pretouch serve-fci` as a command."""

import csv
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from pretouch.cli import main
from pretouch.cli.skin_keys import with_new
from pretouch.hardware.keys import Keys, save_keys
from pretouch.hardware.receiver import SkinReceiver
from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.serving.fci.wire import CONNECT, HEADER, PANDA


def _served(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "pretouch.cli", "serve-fci", "--port", "0", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": ""})


def _address(server: subprocess.Popen[str]) -> tuple[str, int]:
    assert server.stdout is not None
    line = server.stdout.readline()
    assert line.startswith("Listening at 127.0.0.1:")
    return "127.0.0.1", int(line.split(":")[1].split()[0])


def test_it_says_where_it_listens_and_ends_in_order_on_sigterm(tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    with _served("--truth", str(truth), "--scene", "static", "--start", "path", "--push", "0:0,10,0:60") as server:
        with socket.create_connection(_address(server)) as tcp, socket.socket(type=socket.SOCK_DGRAM) as udp:
            udp.bind(("127.0.0.1", 0))
            tcp.sendall(PANDA.reply("Connect", 1, CONNECT.pack(5, udp.getsockname()[1])))
            assert tcp.recv(64)[HEADER.size :] == b"\0\5\0"
            udp.settimeout(5.0)
            for _ in range(50):
                assert len(udp.recv(4096)) == PANDA.state.itemsize
        server.send_signal(signal.SIGTERM)
        assert server.wait(10.0) == 128 + signal.SIGTERM
    rows = list(csv.DictReader(truth.read_text().splitlines()))
    assert len(rows) >= 50
    assert float(rows[40]["force_y_N"]) == 10.0


def test_its_units_are_heard_in_real_time(tmp_path: Path) -> None:
    skin = paper_skin(RobotModel(fr3()))
    keys = with_new(Keys(), skin.ids)
    save_keys(keys, tmp_path / "keys.toml")
    with SkinReceiver(skin.ids, keys) as receiver:
        units = f"127.0.0.1:{receiver.address[1]}"
        with _served("--robot", "fr3", "--units", units, "--keys", str(tmp_path / "keys.toml")) as server:
            _address(server)
            while not all(unit.accepted for unit in receiver.units):
                receiver.receive(timeout=5.0)
            server.terminate()
            server.wait(10.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "70000"], "must be at most 65535"),
        (["--host", "192.0.2.1"], "Nothing can be served at 192.0.2.1:1337"),
        (["--drop", "3"], "as 3/50"),
        (["--push", "1:2"], "as 2.0:0,15,0:0.5"),
        (["--units", "7337"], "give address and port"),
        (["--units", "127.0.0.1:7337"], "needs --keys"),
        (["--hand", "--scene", "static"], "--hand goes with --scene empty"),
        (["--seed", "-1"], "give 0 or more"),
        (["--truth", "/nowhere/truth.csv"], "The truth cannot be written"),
    ],
)
def test_what_cannot_be_served_is_said_in_a_sentence(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve-fci", *arguments]) == 2
    assert words in capsys.readouterr().err
