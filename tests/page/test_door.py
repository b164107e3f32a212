"""The door of a page, tried from outside: by pages of others, by strangers, and by visitors."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.page.visitor import answered, control, refusal, until
from tests.ports import free_port

from pretouch.errors import ViewerError
from pretouch.page import door as door_module
from pretouch.page.live import LivePage
from pretouch.page.panel import PERIOD_S
from pretouch.page.server import ServeOptions, check_port, served

ADDRESS = "Open the page at the address that the program printed: each start has its own.\n"
DRAG = {
    "type": "SceneNodeDragMessage", "phase": "start", "name": "/hand/grip", "instance_index": None,
    "start_position": [0.8, 0.2, 0.2], "start_screen_pos": [0.5, 0.5], "end_position": [0.9, 0.3, 0.4],
    "end_screen_pos": [0.6, 0.5], "button": "left", "modifier": None, "owner": "",
}  # fmt: skip


@pytest.fixture(scope="module")
def door():
    """One page for all that is refused."""
    options = ServeOptions(port=free_port())
    with served(options, "test"):
        yield options


def turns(page: LivePage, count: int) -> None:
    for number in range(count):
        page.turn(number * PERIOD_S)


# who comes in


def test_the_address_with_its_token_is_answered_and_tells_it_to_nobody_else(door):
    status, text, kind = answered(door)
    assert (status, kind) == (200, "text/html")
    assert text.startswith("<!doctype html>")
    assert "<title>test</title>" in text
    assert refusal(door) == (101, "")
    assert refusal(door, origin=f"http://127.0.0.1:{door.port}") == (101, "")


PLAIN = [b"/", b"/index.html", b"/wrong/", b"/wrong/index.html", b"/?token=", b"//"]
NOT_ASCII = [b"/\xff", b"/\xc3\xa9/", b"/{token}\xff/", b"/\xff/{token}/", "/tokén/".encode()]


@pytest.mark.parametrize("path", PLAIN + NOT_ASCII)
def test_without_the_token_there_is_a_sentence(door, path):
    path_of_door = path.replace(b"{token}", door.token.encode())
    assert answered(door, path_of_door) == (403, ADDRESS, "text/plain; charset=utf-8")
    if path in PLAIN:
        assert refusal(door, path.decode()) == (403, ADDRESS)


@pytest.mark.parametrize("rest", [b"\xff", b"\xc3\xa9.js", b"%ff", b"%00", b"../%2e%2e/\xff", b"?\xff"])
def test_behind_the_token_a_path_that_is_not_ascii_is_a_file_or_none(door, rest):
    assert answered(door, b"/" + door.token.encode() + b"/" + rest)[0] in (200, 404)


@pytest.mark.parametrize(
    ("header", "line"),
    [("This page is not at", b"Host: \xff"), ("Pages of", b"Host: 127.0.0.1:{port}\r\nOrigin: http://\xff")],
)
def test_a_header_that_is_not_ascii_is_refused_in_a_sentence(door, header, line):
    status, text, _ = answered(door, b"/", line.replace(b"{port}", str(door.port).encode()))
    assert (status, text.startswith(header)) == (403, True)


def test_a_page_of_somebody_else_does_not_get_in_though_it_knows_the_token(door):
    for origin in ("http://evil.example", "null", f"http://127.0.0.1:{door.port + 1}", "http://127.0.0.1"):
        assert refusal(door, origin=origin) == (403, f"Pages of {origin} may not use this one. {ADDRESS}")


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "localhost.", "", "[", "a b"])
def test_a_name_that_leads_here_but_is_not_ours_does_not_get_in(door, host):
    assert answered(door, headers=f"Host: {host}:{door.port}".encode())[0] in (400, 403)


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "192.168.1.7", "[::1]"])
def test_numbers_and_names_of_this_machine_get_in(door, host):
    assert answered(door, headers=f"Host: {host}:{door.port}".encode())[0] == 200


def test_nobody_can_have_the_page_shared(visitor, monkeypatch):
    tunnels: list[object] = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *place: tunnels.append(place))
    visitor.say({"type": "ShareUrlRequest"})
    visitor.settle()
    visitor.wait_for_callbacks()
    assert tunnels == []


def test_a_server_begun_round_the_door_is_not_kept(options, monkeypatch):
    monkeypatch.setattr(door_module, "websockets_server", SimpleNamespace(serve=None))
    with pytest.raises(ViewerError, match=r"install viser 1\.1\.1"), served(options, "test"):
        pass
    check_port(options)  # it has been stopped


# what is said


def test_what_a_page_says_is_done(page, visitor):
    before = page._simulation.hand_target
    visitor.set(control(page, "Profile"), "blind")
    visitor.set(control(page, "Pause"), True)
    visitor.say(DRAG)
    until(lambda: len(page.actions) == 3)
    turns(page, 1)
    assert page.controls.paused
    assert page._simulation.settings.profile.name == "blind"
    assert not np.allclose(page._simulation.hand_target, before, atol=0.05)
    visitor.type_text(control(page, "Profile text"), " paper:detect.f_base_n=8 ")
    turns(page, 1)
    assert page._simulation.settings.profile.name == "paper:detect.f_base_n=8"
    visitor.type_text(control(page, "Profile text"), "paper:approach.d_crit_m=0.9")
    turns(page, 1)
    assert page.status.notice.startswith("Not done: ApproachRestriction.d_notice_m is 0.6: it must be greater")
    assert page._simulation.settings.profile.name == "paper:detect.f_base_n=8"
    assert control(page, "Profile text").value == "paper:approach.d_crit_m=0.9"  # stays to be put right


def test_sixty_clicks_on_record_begin_one_recording(page, visitor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    now = 0.0
    for _ in range(60):
        visitor.set(control(page, "Record"), True)
        visitor.settle()
        now += PERIOD_S
        page.turn(now)
    for _ in range(20):
        now += PERIOD_S
        page.turn(now)
    assert [place.name for place in Path("runs").iterdir()] == ["live-1.mcap"]
    page._simulation.stop_recording()
