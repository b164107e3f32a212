"""Serving the live page: what is said, how it ends, what no error ends; and where a page is served."""

import re
import signal
import socket
import subprocess
import sys
import time

import pytest
from tests.ports import free_port

from pretouch.errors import ViewerError
from pretouch.page.live import serve_live
from pretouch.page.scene import Scene
from pretouch.page.server import ServeOptions, check_port, served, url_of
from pretouch.recording.reader import open_recording
from pretouch.recording.writer import Recording


def test_the_address_is_the_one_line_that_is_said(simulation, capfd):
    options, turns = ServeOptions(port=free_port()), iter([False, False, True])
    serve_live(simulation, options, until=lambda: next(turns))
    assert capfd.readouterr().out == f"The arm is at {url_of(options)} (Ctrl-C ends it).\n"


def test_a_recording_in_trouble_is_said_once_on_the_page_and_in_the_terminal(simulation, tmp_path, monkeypatch):
    simulation.start_recording(tmp_path / "session.mcap")
    monkeypatch.setattr(Recording, "trouble", property(lambda self: "The recording ended early (disk full)."))
    turns, lines = iter([False] * 5 + [True]), []
    serve_live(simulation, ServeOptions(port=free_port()), lambda: next(turns), lines.append)
    assert lines[1:] == ["The recording ended early (disk full)."]


def test_beyond_this_machine_it_is_said_what_is_exposed_and_the_page_is_opened_where_asked(simulation, monkeypatch):
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    options, lines = ServeOptions("0.0.0.0", free_port(), opened=True), []  # noqa: S104
    serve_live(simulation, options, lambda: True, lines.append)
    assert lines == [
        f"The arm is at {url_of(options)} (Ctrl-C ends it).",
        "Mind: other machines reach this page, unencrypted. Whoever has the address can move the simulated arm, and"
        " record to the disk of this one.",
    ]
    assert opened == [f"http://localhost:{options.port}/{options.token}/"]


def test_whatever_fails_in_the_page_the_arm_holds_and_it_is_said_once(simulation, monkeypatch):
    def fail(*_: object) -> None:
        raise KeyError("nosuch")

    monkeypatch.setattr("viser.ViserServer.get_clients", lambda self: {0: None})
    turns, lines, times = iter([False] * 5 + [True]), [], []

    def until() -> bool:
        times.append(simulation.time)
        if len(times) == 3:
            monkeypatch.setattr(Scene, "draw", fail)
        return next(turns)

    serve_live(simulation, ServeOptions(port=free_port()), until, lines.append)
    assert lines[1:] == ["The page failed, and holds: KeyError: 'nosuch'. Please report this."]
    assert times[1] < times[2]
    assert times[-1] == times[-2] == times[-3]


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_it_closes_its_recording_and_says_where_it_is(number, code, tmp_path):
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


# the server of any page


def test_a_second_page_on_the_same_port_is_refused_in_a_sentence_and_the_first_goes_on(capfd):
    options = ServeOptions(port=free_port())
    sentence = f"Port {options.port} on 127.0.0.1 is in use, perhaps by another page: choose another with --port."
    with served(options, "first") as server:
        with pytest.raises(ViewerError, match=re.escape(sentence)), served(options, "second"):
            pass
        assert server.get_port() == options.port
    check_port(options)
    assert capfd.readouterr().out == ""


def test_a_page_is_for_this_machine_alone_unless_asked():
    assert ServeOptions().host == "127.0.0.1"
    for host, name in (("127.0.0.1", "127.0.0.1"), ("0.0.0.0", "localhost"), ("::", "localhost"), ("::1", "[::1]")):  # noqa: S104
        options = ServeOptions(host, 1234)
        assert url_of(options) == f"http://{name}:1234/{options.token}/"


def test_each_start_has_an_address_that_nobody_can_guess_or_read_in_an_error():
    one, other = ServeOptions(), ServeOptions()
    assert one.token != other.token
    assert len(one.token) >= 43  # 256 bits, six to a character
    assert one.token not in repr(one)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_what_is_no_port_is_refused(port):
    with pytest.raises(ViewerError, match="from 1 to 65535"):
        check_port(ServeOptions(port=port))


def test_a_host_that_is_not_this_machine_is_refused():
    with pytest.raises(ViewerError, match=r"192\.0\.2\.1"):
        check_port(ServeOptions("192.0.2.1", free_port()))
