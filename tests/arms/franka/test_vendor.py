"""What both of the vendor's clients do around a library, over states that are given."""

import pytest

from pretouch.arms.franka.state import FrankaState
from pretouch.arms.franka.vendor import VendorClient
from pretouch.errors import RobotError
from tests.arms.franka.made import state


class GivenStates(VendorClient):
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
