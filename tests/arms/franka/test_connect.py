"""What stands in the way of an arm is one sentence, and soon."""

import os
import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from pretouch.arms.franka import arm, connection
from pretouch.arms.franka.arm import FrankaArm
from pretouch.arms.franka.connection import ArmLock, FrankaClient, Kind, reachable
from pretouch.arms.franka.state import MODES, FrankaState
from pretouch.errors import MissingExtraError, RobotError
from pretouch.robot.model import RobotModel
from tests.arms.franka.made import state
from tests.ports import loopback


@pytest.mark.parametrize(("kind", "library", "version"), [("panda", "panda-python", 5), ("fr3", "pylibfranka", 10)])
def test_what_was_tried_is_said_and_the_way_out(kind: Kind, library: str, version: int) -> None:
    sentence = (
        rf"No Franka arm at 127\.0\.99\.99: nothing listens on port 1337 there \(tried for \d\.\d s: TCP port 1337, for"
        rf" {library}, which speaks version {version} of the Franka Control Interface \(FCI\)\)\. Check the address and"
        r" the cable, unlock the joints and activate FCI in Desk\."
    )
    began = time.monotonic()
    with pytest.raises(RobotError, match=f"^{sentence}$"):
        reachable("127.0.99.99", kind)
    assert time.monotonic() - began < 10.0
    text = "libfranka: UDP receive: Timeout\nmore"
    error = connection.not_connected("1.2.3.4", kind, time.monotonic() - 4.0, RuntimeError(text))
    assert re.search(rf"did not continue .UDP receive: Timeout; tried for 4\.. s: .*for {library}, ", str(error))


def test_a_name_that_nobody_has_or_can_have_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RobotError, match=r"No Franka arm at a\.\.b: there is no host of that name \(tried for"):
        reachable("a..b", "fr3")

    def unknown(*_: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(connection.socket, "create_connection", unknown)
    with pytest.raises(RobotError, match=r"No Franka arm at no-such-arm: there is no host of that name \(tried for"):
        reachable("no-such-arm", "fr3")


def test_an_arm_that_does_not_answer_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(_address: tuple[str, int], timeout: float) -> None:
        assert timeout == connection.ANSWER_S
        raise TimeoutError

    monkeypatch.setattr(connection.socket, "create_connection", silent)
    with pytest.raises(RobotError, match="nothing answers within 3 s"):
        reachable("172.16.0.2", "fr3")


def test_the_sentence_comes_from_the_process_too(panda_model: RobotModel) -> None:
    with pytest.raises(RobotError, match=r"^No Franka arm at 127\.0\.99\.99: nothing listens .* FCI in Desk\.$"):
        FrankaArm("127.0.99.99", "panda", panda_model)


@pytest.mark.parametrize(("kind", "library"), [("panda", "panda_py"), ("fr3", "pylibfranka")])
def test_a_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch, kind: Kind, library: str) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtraError, match=f"needs {library} of the extra 'franka'"):
        FrankaClient("127.0.99.99", kind)


@pytest.mark.parametrize("mode", [mode for mode in MODES if mode != "idle"])
def test_each_mode_in_which_the_arm_does_not_move_has_a_way_out(mode: str) -> None:
    with pytest.raises(RobotError, match=f'^The arm at robot is in mode "{mode}" after joint_reflex; .*\\.$'):
        connection.check_ready(state(mode=mode, errors=("joint_reflex",)), "robot")
    connection.check_ready(state(mode="idle"), "robot")


def test_a_process_that_holds_an_arm_is_named_and_lets_go_when_it_is_killed() -> None:
    address = loopback()
    holds = f"ArmLock({address!r}); print(1, flush=True); input()"
    script = f"from pretouch.arms.franka.connection import ArmLock; held = {holds}"
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "1\n"
        with pytest.raises(RobotError, match=f"The arm at {address} is in use by process {process.pid} on"):
            ArmLock(address)
        for _ in range(300):  # more than wait at a door that nobody opens
            with pytest.raises(RobotError, match=f"The arm at {address} is in use by "):
                ArmLock(address)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    ArmLock(address).release()
    ArmLock(address).release()


def test_a_machine_that_takes_the_connection_and_is_silent_is_given_up(
    panda_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arm, "_START_S", 3.0)
    address, began = loopback(), time.monotonic()
    with (
        socket.create_server((address, connection.PORT)),
        pytest.raises(RobotError, match=f"The host at {address} accepts connections, but does not answer as an arm"),
    ):
        FrankaArm(address, "panda", panda_model)
    assert time.monotonic() - began < 10.0
    ArmLock(address).release()


class GivenStates(FrankaClient):
    """Reads these modes one after the other, and the last one from then on; takes the order to recover."""

    def __init__(self, *modes: str) -> None:
        self._address, self._robot, self._modes = "arm", self, list(modes)
        self.states = self.asked = 0

    def automatic_error_recovery(self) -> None:
        self.asked += 1

    def read(self) -> FrankaState:
        self.states += 1
        mode = self._modes.pop(0) if len(self._modes) > 1 else self._modes[0]
        return state(mode=mode, errors=("joint_reflex",) if mode == "reflex" else ())


@pytest.mark.parametrize("before", [(), ("reflex",), ("reflex", "reflex", "automatic error recovery")])
@pytest.mark.parametrize("after", ["idle", "user stopped"])
def test_recovery_lasts_until_a_state_tells_of_it(before: tuple[str, ...], after: str) -> None:
    client = GivenStates(*before, after)
    client.recover()
    assert client.asked == 1
    assert client.states == len(before) + 1


def test_an_arm_that_does_not_recover_is_told() -> None:
    client = GivenStates("reflex")
    with pytest.raises(RobotError, match=r'told to recover but is still in mode "reflex" after joint_reflex: free'):
        client.recover()
    assert client.states == 500
