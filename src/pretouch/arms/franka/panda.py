"""The Panda through panda-python's libfranka 0.9, which calls back in each millisecond of a motion."""

from typing import Any, ClassVar, Literal

from panda_py import libfranka

from pretouch.arms.franka.vendor import VendorClient

_NO_LOW_PASS_HZ = 1000.0
"""Cut-off frequency that the library takes for no filter; by default it filters at 100 Hz and limits rates."""


class PandaClient(VendorClient):
    """See `VendorClient`."""

    kind: Literal["panda", "fr3"] = "panda"
    library: ClassVar[Any] = libfranka

    def _move(self, answer: Any) -> None:
        mode = libfranka.ControllerMode.kJointImpedance
        self._robot.control_joint_velocity(answer, mode, False, _NO_LOW_PASS_HZ)


open_client = PandaClient
