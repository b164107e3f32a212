"""The door of a page, tried from outside: by pages of others, by strangers, and by visitors who lie or shout."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.ports import free_port
from tests.viewer.visitor import CAMERA, Visitor, answered, fetched, refusal, until, update

from pretouch.errors import ViewerError
from pretouch.viewer.commander import Commander
from pretouch.viewer.door import BURST, Door, Refused, _understood
from pretouch.viewer.live import PERIOD_S, LivePage
from pretouch.viewer.server import ServeOptions, served
from pretouch.viewer.simulation import LiveSimulation

ADDRESS = "Open the page at the address that the program printed: each start has its own.\n"
DRAG = {
    "type": "SceneNodeDragMessage", "phase": "start", "name": "/hand/grip", "instance_index": None,
    "start_position": [0.8, 0.2, 0.2], "start_screen_pos": [0.5, 0.5], "end_position": [0.9, 0.3, 0.4],
    "end_screen_pos": [0.6, 0.5], "button": "left", "modifier": None, "owner": "",
}  # fmt: skip


@contextmanager
def live() -> Iterator[tuple[LivePage, ServeOptions]]:
    options = ServeOptions(port=free_port())
    with served(options, "test") as server:
        yield LivePage(server, LiveSimulation()), options


@pytest.fixture(scope="module")
def unmoved() -> Iterator[tuple[LivePage, ServeOptions]]:
    """One page for all that is refused: each test finds it as it was."""
    with live() as found:
        yield found
        turns(found[0], 3)
        assert found[0]._simulation.settings.profile.name == "paper"


@pytest.fixture
def options(unmoved: tuple[LivePage, ServeOptions]) -> ServeOptions:
    return unmoved[1]


@pytest.fixture
def liar(unmoved: tuple[LivePage, ServeOptions]) -> Iterator[Visitor]:
    with Visitor(unmoved[0]._server, unmoved[1]) as somebody:
        yield somebody
        somebody.settle()
        assert len(unmoved[0]._actions) == 0


@pytest.fixture
def place() -> Iterator[tuple[LivePage, ServeOptions]]:
    with live() as found:
        yield found


@pytest.fixture
def page(place: tuple[LivePage, ServeOptions]) -> LivePage:
    return place[0]


@pytest.fixture
def visitor(place: tuple[LivePage, ServeOptions]) -> Iterator[Visitor]:
    with Visitor(place[0]._server, place[1]) as somebody:
        yield somebody


def control(page: LivePage, label: str) -> Any:
    handles = page._server.gui._gui_input_handle_from_uuid.values()
    return next(found for found in handles if getattr(found, "label", None) == label)


def turns(page: LivePage, count: int) -> None:
    for number in range(count):
        page.turn(number * PERIOD_S)


# who comes in


def test_the_address_with_its_token_is_answered_and_tells_it_to_nobody_else(options: ServeOptions) -> None:
    status, text, kind = fetched(options)
    assert (status, kind) == (200, "text/html")
    assert text.startswith("<!doctype html>")
    assert refusal(options) == (101, "")
    assert refusal(options, origin=f"http://127.0.0.1:{options.port}") == (101, "")


@pytest.mark.parametrize("path", ["/", "/index.html", "/wrong/", "/wrong/index.html", "/?token=", "//"])
def test_without_the_token_there_is_a_sentence(options: ServeOptions, path: str) -> None:
    assert fetched(options, path) == (403, ADDRESS, "text/plain; charset=utf-8")
    assert refusal(options, path) == (403, ADDRESS)


@pytest.mark.parametrize("path", [b"/\xff", b"/\xc3\xa9/", b"/{token}\xff/", b"/\xff/{token}/", "/tokén/".encode()])
def test_a_path_that_is_not_ascii_is_refused_like_any_other(options: ServeOptions, path: bytes) -> None:
    status, text = answered(options, path.replace(b"{token}", options.token.encode()))
    assert (status, text) == (403, ADDRESS)


@pytest.mark.parametrize("rest", [b"\xff", b"\xc3\xa9.js", b"%ff", b"%00", b"../%2e%2e/\xff", b"?\xff"])
def test_behind_the_token_a_path_that_is_not_ascii_is_a_file_or_none(options: ServeOptions, rest: bytes) -> None:
    assert answered(options, b"/" + options.token.encode() + b"/" + rest)[0] in (200, 404)


@pytest.mark.parametrize(
    ("header", "line"),
    [("This page is not at", b"Host: \xff"), ("Pages of", b"Host: 127.0.0.1:{port}\r\nOrigin: http://\xff")],
)
def test_a_header_that_is_not_ascii_is_refused_in_a_sentence(options: ServeOptions, header: str, line: bytes) -> None:
    status, text = answered(options, b"/", line.replace(b"{port}", str(options.port).encode()))
    assert (status, text.startswith(header)) == (403, True)


def test_a_page_of_somebody_else_does_not_get_in_though_it_knows_the_token(options: ServeOptions) -> None:
    for origin in ("http://evil.example", "null", f"http://127.0.0.1:{options.port + 1}", "http://127.0.0.1"):
        said = f"Pages of {origin} may not use this one. {ADDRESS}"
        assert refusal(options, origin=origin) == (403, said)


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "localhost.", "", "[", "a b"])
def test_a_name_that_leads_here_but_is_not_ours_does_not_get_in(options: ServeOptions, host: str) -> None:
    assert fetched(options, Host=f"{host}:{options.port}")[0] in (400, 403)


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "192.168.1.7", "[::1]"])
def test_numbers_and_names_of_this_machine_get_in(options: ServeOptions, host: str) -> None:
    assert fetched(options, Host=f"{host}:{options.port}")[0] == 200


def test_nobody_can_have_the_page_shared(
    unmoved: tuple[LivePage, ServeOptions], liar: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    server = unmoved[0]._server
    monkeypatch.setattr(server, "request_share_url", lambda: asked.append(0))
    liar.say({"type": "ShareUrlRequest"})
    assert "does not know what to do" in liar.heard("NotificationShowMessage")["props"]["body"]
    assert not [kind for kind in server._websock_server._incoming_handlers if "Share" in kind.__name__]
    server._thread_executor.submit(int).result()
    assert asked == []


def test_a_server_begun_round_the_door_is_not_kept() -> None:
    with pytest.raises(ViewerError, match=r"install viser 1\.1\.1"):
        Door(ServeOptions()).keep(None)  # type: ignore[arg-type]


# what is said


@pytest.mark.parametrize(
    ("label", "updates", "said"),
    [("Profile", {"value": "nosuch"}, "Profile cannot be nosuch: choose "),
     ("Profile", {"value": ["paper"]}, "Profile cannot be ['paper']: choose "),
     ("Clock speed", {"value": math.nan}, "Clock speed cannot be nan: give a number."),
     ("Clock speed", {"value": math.inf}, "Clock speed cannot be inf: give a number."),
     ("Clock speed", {"value": "abc"}, "Clock speed cannot be abc: give a number."),
     ("Clock speed", {"value": True}, "Clock speed cannot be True: give a number."),
     ("Clock speed", {"value": -1e300}, "Clock speed cannot be -1e+300: give a number."),
     ("Path", {"removed": True}, "Path cannot be changed now."),
     ("Path", {"value": "line", "removed": True}, "Path cannot be changed now."),
     ("Path", {"update_cb": []}, "Path cannot be changed now."),
     ("Path", {}, "Path cannot be changed now."),
     ("Cones", {"value": 1}, "Cones cannot be 1: tick it, or leave it empty."),
     ("d_crit [m]", {"value": "1" * 41}, f"d_crit [m] cannot be {'1' * 40}: write at most 40 characters."),
     ("d_crit [m]", {"value": 0.1}, "d_crit [m] cannot be 0.1: write at most 40 characters."),
     ("Pause", {"value": False}, "Pause cannot be False: press it."),
     ("Resume: nothing waits for it", {"value": True}, "Resume: nothing waits for it cannot be changed now."),
     ("Take command", {"value": True}, "Take command cannot be changed now.")],
)  # fmt: skip
def test_what_a_control_cannot_have_is_refused_said_and_shown_again(
    unmoved: tuple[LivePage, ServeOptions], liar: Visitor, label: str, updates: dict[str, Any], said: str
) -> None:
    handle = control(unmoved[0], label)
    before = handle.value
    liar.say(update(handle, **updates))
    assert liar.heard("NotificationShowMessage")["props"]["body"].startswith(said)
    assert handle.value == before
    assert not handle._impl.removed


def test_a_visitor_sees_again_what_holds(unmoved: tuple[LivePage, ServeOptions], liar: Visitor) -> None:
    handle = control(unmoved[0], "Clock speed")
    liar.set(handle, "abc")
    told = liar.heard("GuiUpdateMessage")
    while told["uuid"] != handle._impl.uuid or "value" not in told["updates"]:
        told = liar.heard("GuiUpdateMessage")
    assert told["updates"] == {"value": 1.0}


def test_a_number_out_of_range_is_the_nearest_in_it(page: LivePage, visitor: Visitor) -> None:
    handle = control(page, "Force [N]")
    for number, taken in ((30.0, 30.0), (7, 7.0), (0, 5.0), (61.0, 60.0), (-1e6, 5.0)):
        visitor.set(handle, number)
        visitor.settle()
        assert handle.value == taken


def test_what_a_page_says_is_done(page: LivePage, visitor: Visitor) -> None:
    before = page._simulation.hand_target
    visitor.set(control(page, "Profile"), "blind")
    visitor.set(control(page, "Pause"), True)
    visitor.say(DRAG)
    until(lambda: len(page._actions) == 3)
    turns(page, 1)
    assert page.controls.running.paused
    assert page._simulation.settings.profile.name == "blind"
    assert not np.allclose(page._simulation.hand_target, before, atol=0.05)


@pytest.mark.parametrize(
    "message",
    [{**CAMERA, "position": [math.nan, 0.0, 0.0]}, {**CAMERA, "position": [0.0, 0.0]}, {**CAMERA, "far": 1e300},
     {**CAMERA, "position": "abc"}, {"type": "ViewerCameraMessage"}, {"type": "NoSuchMessage"}, {"type": []}, {},
     {**DRAG, "end_position": [math.inf, 0.0, 0.0]}, {**DRAG, "phase": "begin"}, {**DRAG, "name": 3},
     {"type": "GuiUpdateMessage", "uuid": "nosuch", "updates": {"value": 1}},
     {"type": "GuiUpdateMessage", "uuid": "nosuch", "updates": [1]},
     {"type": "GuiCloseModalMessage", "uuid": "nosuch"}, {"type": "RunJavascriptMessage", "source": "alert()"}],
)  # fmt: skip
def test_what_is_no_message_of_a_page_is_refused_and_the_visitor_stays(liar: Visitor, message: dict[str, Any]) -> None:
    liar.say(message)
    assert liar.heard("NotificationShowMessage")["props"]["title"] == "Not done"


def test_fields_that_no_message_has_are_left_out(page: LivePage, visitor: Visitor) -> None:
    visitor.say({**update(control(page, "Pause"), value=True), "nosuch": 1})
    until(lambda: len(page._actions) == 1)


@pytest.mark.parametrize("depth", [2, 50, 500, 2000])
def test_lists_in_lists_are_refused_and_the_visitor_stays(
    unmoved: tuple[LivePage, ServeOptions], liar: Visitor, depth: int
) -> None:
    nested = b"\x91" * depth + b"\x90"
    for label in ("Profile", "Clock speed", "Cones"):
        change = msgspec.msgpack.encode(update(control(unmoved[0], label), value=None))
        assert change.endswith(b"\xc0")
        liar.say_raw(change[:-1] + nested)
    liar.say_raw(msgspec.msgpack.encode({**CAMERA, "nosuch": None})[:-1] + nested)
    assert liar.heard("NotificationShowMessage")["props"]["title"] == "Not done"


@given(st.binary(max_size=80) | st.recursive(st.none() | st.floats() | st.text(), st.lists).map(msgspec.msgpack.encode))
def test_any_bytes_are_refused_without_another_error(raw: bytes) -> None:
    with pytest.raises(Refused):
        _understood(raw)


def test_a_message_that_is_too_large_ends_its_connection_alone(
    unmoved: tuple[LivePage, ServeOptions], liar: Visitor
) -> None:
    with Visitor(unmoved[0]._server, unmoved[1]) as other:
        other.say({**CAMERA, "type": "x" * 10_000})
        until(lambda: other.number not in unmoved[0]._server.get_clients())


# how often


def test_who_shouts_is_heard_at_a_bounded_rate_and_told(page: LivePage, visitor: Visitor) -> None:
    heard: list[object] = []
    step = control(page, "Single step")
    step.on_click(lambda _: heard.append(0))
    before = page._simulation.time
    for _ in range(20_000):
        visitor.set(step, True)
    body = visitor.heard("NotificationShowMessage")["props"]["body"]
    assert body == "More than 100 messages a second: those beyond are left out."
    visitor.settle()
    assert len(page._actions) == 1
    turns(page, 3)
    assert page._simulation.time - before == pytest.approx(0.01)
    assert BURST <= len(heard) < 10_000


def test_sixty_clicks_on_record_begin_one_recording(
    page: LivePage, visitor: Visitor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


# who commands


def test_one_visitor_commands_all_see_who_and_the_others_look(
    place: tuple[LivePage, ServeOptions], visitor: Visitor
) -> None:
    page, options = place
    pause, speed, take = (control(page, label) for label in ("Pause", "Clock speed", "Take command"))
    assert not take.visible
    with Visitor(page._server, options) as other:
        assert take.visible
        assert shown(page) == "Nobody commands: the first to act does."
        visitor.set(pause, True)
        visitor.settle()
        assert shown(page) == "Visitor 1 commands."
        for message in (update(pause, value=True), update(speed, value=0.5), DRAG):
            other.say(message)
        refused = other.heard("NotificationShowMessage")["props"]["body"]
        assert refused == "Visitor 1 commands: press Take command first."
        other.settle()
        assert len(page._actions) == 1
        assert speed.value == 1.0
        other.set(take, True)
        other.set(speed, 0.5)
        other.settle()
        assert shown(page) == "Visitor 2 commands."
        assert speed.value == 0.5
        visitor.set(speed, 0.7)
        visitor.settle()
        assert speed.value == 0.5
    until(lambda: not take.visible)
    visitor.set(speed, 0.7)
    visitor.settle()
    assert speed.value == 0.7


def test_who_comes_while_another_commands_is_told_so(place: tuple[LivePage, ServeOptions], visitor: Visitor) -> None:
    page, options = place
    visitor.set(control(page, "Pause"), True)
    visitor.settle()
    with Visitor(page._server, options) as other:
        told = other.heard("NotificationShowMessage")["props"]
        assert (told["title"], told["body"]) == ("You are Visitor 2", "Visitor 1 commands.")


def test_who_has_not_said_where_he_looks_from_commands_nothing(
    place: tuple[LivePage, ServeOptions], visitor: Visitor
) -> None:
    page, options = place
    pause = control(page, "Pause")
    with Visitor.unseen(options) as ghost:
        ghost.send(msgspec.msgpack.encode(update(pause, value=True)))
        ghost.send(msgspec.msgpack.encode(update(control(page, "Take command"), value=True)))
        assert ghost.ping().wait(20.0)
    visitor.set(pause, True)
    visitor.settle()
    assert shown(page) == "Visitor 1 commands."


def shown(page: LivePage) -> str:
    """What the page says of who commands."""
    (commander,) = {told.__self__ for told in page._server._client_disconnect_cb if hasattr(told, "__self__")}
    assert isinstance(commander, Commander)
    return commander._line.content.split(">", 1)[1].removesuffix("</div>")
