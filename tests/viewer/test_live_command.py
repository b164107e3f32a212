"""`pretouch live` as a process: how it refuses to start, and how it ends."""

import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.ports import free_port

from pretouch.cli import main
from pretouch.extras import LIVE
from pretouch.recording.reader import open_recording


def test_a_busy_port_is_one_sentence_with_the_next_free_one(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["live", "--port", str(port)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith(f"Port {port} on 127.0.0.1 is in use")
    assert "is free" in err


def test_a_missing_extra_is_one_sentence_with_the_command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["live"]) == 2
    assert capsys.readouterr().err == f"The page needs viser of the extra 'live': run {LIVE.command}\n"


def test_an_unknown_path_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", "--path", "spiral", "--port", str(free_port())]) == 2
    assert capsys.readouterr().err == "The path is 'spiral': choose circle or line.\n"


def test_a_seed_below_zero_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", "--seed", "-1", "--port", str(free_port())]) == 2
    assert capsys.readouterr().err == "LiveSettings.seed is -1: it must be at least 0.\n"


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_it_closes_its_recording_and_says_where_it_is(
    number: signal.Signals, code: int, tmp_path: Path
) -> None:
    place, port = tmp_path / "session.mcap", free_port()
    command = [sys.executable, "-m", "pretouch.cli", "live", "--port", str(port), "--record", str(place)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith(f"The arm is at http://127.0.0.1:{port}/")
        deadline = time.monotonic() + 60
        while place.stat().st_size < 100_000:
            assert time.monotonic() < deadline, "nothing is being recorded"
            time.sleep(0.05)
        with socket.create_connection(("127.0.0.1", port)):
            process.send_signal(number)
        rest = process.stdout.read()
    assert process.returncode == code
    assert str(place) in rest
    assert "Traceback" not in rest
    assert open_recording(place).complete
