"""The FR3 through pylibfranka, which is asked for each state of a motion and given each command.

That way libfranka neither limits nor filters what it is given: it does so for callbacks alone.
"""

from typing import Any, ClassVar, Literal

import pylibfranka

from pretouch.arms.franka.vendor import VendorClient


class Fr3Client(VendorClient):
    """See `VendorClient`."""

    kind: Literal["panda", "fr3"] = "fr3"
    library: ClassVar[Any] = pylibfranka
    failures: ClassVar[tuple[type[Exception], ...]] = (RuntimeError, pylibfranka.FrankaException)

    def _move(self, answer: Any) -> None:
        motion = self._robot.start_joint_velocity_control(pylibfranka.ControllerMode.JointImpedance)
        finished = False
        try:
            while not finished:
                command = answer(*motion.readOnce())
                finished = command.motion_finished
                motion.writeOnce(command)
        finally:
            # the library stops the arm when it forgets a motion that has not ended; an exception would remember it
            del motion


open_client = Fr3Client
