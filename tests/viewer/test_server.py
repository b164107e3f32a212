import socket
import sys

import pytest
from tests.ports import free_port

from pretouch.errors import MissingExtraError, ViewerError
from pretouch.extras import LIVE
from pretouch.viewer.server import ServeOptions, check_port, served, url_of


def test_a_busy_port_is_one_sentence_with_the_next_free_one() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ViewerError) as caught:
            check_port(ServeOptions(port=port))
    said = str(caught.value)
    assert said.startswith(f"Port {port} on 127.0.0.1 is in use")
    assert "\n" not in said
    free = int(said.split("--port ")[1].split()[0])
    assert free > port
    check_port(ServeOptions(port=free))


def test_a_second_page_on_the_same_port_is_refused_and_the_first_goes_on(capfd: pytest.CaptureFixture[str]) -> None:
    options = ServeOptions(port=free_port())
    with served(options, "first") as server:
        with (
            pytest.raises(ViewerError, match=rf"Port {options.port} on 127\.0\.0\.1 is in use"),
            served(options, "second"),
        ):
            pass
        assert server.get_port() == options.port
    check_port(options)
    assert capfd.readouterr().out == ""


def test_a_page_is_for_this_machine_alone_unless_asked() -> None:
    assert ServeOptions().host == "127.0.0.1"
    for host, shown in (("127.0.0.1", "127.0.0.1"), ("0.0.0.0", "localhost"), ("::", "localhost"), ("::1", "[::1]")):  # noqa: S104
        options = ServeOptions(host, 1234)
        assert url_of(options) == f"http://{shown}:1234/{options.token}/"


def test_each_start_has_an_address_that_nobody_can_guess_or_read_in_an_error() -> None:
    one, other = ServeOptions(), ServeOptions()
    assert one.token != other.token
    assert len(one.token) >= 43  # 256 bits, six to a character
    assert one.token not in repr(one)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_what_is_no_port_is_refused(port: int) -> None:
    with pytest.raises(ViewerError, match="from 1 to 65535"):
        check_port(ServeOptions(port=port))


def test_a_host_that_is_not_this_machine_is_refused() -> None:
    with pytest.raises(ViewerError, match=r"192\.0\.2\.1"):
        check_port(ServeOptions("192.0.2.1", free_port()))


def test_a_missing_extra_is_one_sentence_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError) as caught, served(ServeOptions(port=free_port()), "page"):
        pass
    assert str(caught.value) == f"The page needs viser of the extra 'live': run {LIVE.command}"
