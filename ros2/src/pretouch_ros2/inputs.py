"""Topics of an arm: joint states, wrench and external torques, in our order, sign and frame."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch.imported_data.reading import EE_FRAMES
from pretouch.types import FloatArray
from pretouch.values import value
from pretouch_ros2.params import ArmParams
from pretouch_ros2.stamps import SourceStamps

_NAMES_MOST = 1000
"""Most joints of a message; a longer message is ignored."""
_OTHERS_MOST = 64
"""Most names of other joints that are stored: a publisher of ever new names must not fill the memory."""


@value
class JointReading:
    """Joints at one instant."""

    stamp: float
    """Time by this machine's monotonic clock [s]."""
    q: FloatArray
    """(n,) [rad]."""
    qd: FloatArray
    """(n,) [rad/s]."""


def places_of(ours: Sequence[str], names: Sequence[str]) -> list[int] | None:
    """Return where our joints stand among the names of a message; None unless it has all of them."""
    if len(names) > _NAMES_MOST:
        return None
    places = {name: i for i, name in enumerate(names)}
    return [places[name] for name in ours] if all(name in places for name in ours) else None


class Joints:
    """Takes in sensor_msgs/JointState: names in any order, with others beside them."""

    def __init__(self, names: Sequence[str], stamps: SourceStamps) -> None:
        self.names, self.stamps = tuple(names), stamps
        self.newest: JointReading | None = None
        """Last measurement."""
        self.others: set[str] = set()
        """Joints named in messages that do not have all of ours; some of them, where there are many."""
        self.unequal = ""
        """Numbers of names and of positions that differ, as part of a sentence."""
        self.differentiated = False
        """True if the messages have no velocities, so that they are taken from the positions."""

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in; one without all of our joints is another device's."""
        places = places_of(self.names, message.name)
        if places is None:
            few = message.name[:_NAMES_MOST]
            self.others |= set(self.names).intersection(few) | set(few[: max(_OTHERS_MOST - len(self.others), 0)])
            return
        if len(message.position) != len(message.name):
            self.unequal = f"names {len(message.name)} joints and has {len(message.position)} positions"
            return
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is None:
            return
        q = np.array(message.position, dtype=np.float64)[places]
        complete = len(message.velocity) == len(message.position)
        qd = np.array(message.velocity, dtype=np.float64)[places] if complete else None
        self.differentiated = qd is None or not np.isfinite(qd).all()
        self.newest = JointReading(stamp, q, self._difference(stamp, q) if qd is None or self.differentiated else qd)

    @property
    def missing(self) -> tuple[str, ...]:
        """Our joints that no message has named."""
        return tuple(name for name in self.names if name not in self.others)

    def _difference(self, stamp: float, q: FloatArray) -> FloatArray:
        """Velocities (n,) [rad/s] since the last positions."""
        last = self.newest
        if last is None or not stamp > last.stamp:
            return np.zeros(len(q))
        return (q - last.q) / (stamp - last.stamp)


class _ForceEstimate:
    """The newest numbers of one topic."""

    def __init__(self, params: ArmParams, stamps: SourceStamps) -> None:
        self._params, self.stamps = params, stamps
        self._newest: tuple[float, FloatArray] | None = None

    def _note(self, message: Any, received: float, writer: int, values: FloatArray) -> None:
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is not None:
            self._newest = stamp, values

    def _ours(self, now: float) -> FloatArray | None:
        """Return the numbers in our sign, which is on the robot by the environment: the one place where that is done.

        None where they are older at an instant [s] than they may be, or are zeros which mean that there is no estimate.
        """
        if self._newest is None:
            return None
        stamp, numbers = self._newest
        if now - stamp > self._params.wrench_timeout_s or (self._params.zeros_missing and not numbers.any()):
            return None
        return -numbers if self._params.sign == "by-robot" else numbers.copy()


class Wrench(_ForceEstimate):
    """Takes in geometry_msgs/WrenchStamped."""

    received_any = False
    """True if any message came, with an estimate or without."""
    frame_id = ""

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in."""
        self.received_any, self.frame_id = True, message.header.frame_id
        f, t = message.wrench.force, message.wrench.torque
        self._note(message, received, writer, np.array([f.x, f.y, f.z, t.x, t.y, t.z]))

    def read(self, now: float, R_O_ee: FloatArray) -> FloatArray | None:
        """Return force and torque (6,) [N, Nm] on the robot by the environment, base frame, or None.

        Args:
            now: by the monotonic clock [s].
            R_O_ee: (3, 3) orientation of the end-effector.
        """
        ours = self._ours(now)
        if ours is None or not np.isfinite(ours).all():
            return None
        return ours if self._params.frame == "base" else np.concatenate([R_O_ee @ ours[:3], R_O_ee @ ours[3:]])

    @property
    def warning(self) -> str:
        """Sentence on a frame setting that looks wrong, or ''."""
        looks_ee = self.frame_id.lower().endswith(EE_FRAMES)
        if looks_ee == (self._params.frame == "ee") or not self.frame_id:
            return ""
        return (
            f"The wrench's frame_id is {self.frame_id!r}, but the frame is set to {self._params.frame!r}: check the"
            " setting."
        )


class TorqueEstimate(_ForceEstimate):
    """Takes in sensor_msgs/JointState, whose efforts they are."""

    others: tuple[str, ...] = ()
    """Joints named in the newest message that was not of all of ours; some of them, where there are many."""

    def __init__(self, params: ArmParams, names: Sequence[str], stamps: SourceStamps) -> None:
        super().__init__(params, stamps)
        self._names = tuple(names)

    @property
    def received_any(self) -> bool:
        """True if torques of all of our joints came."""
        return self._newest is not None

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in; one without efforts of all of our joints is another device's."""
        places = places_of(self._names, message.name)
        if places is None or len(message.effort) != len(message.name):
            self.others = tuple(message.name[:9])
        else:
            self._note(message, received, writer, np.array(message.effort, dtype=np.float64)[places])

    def read(self, now: float) -> FloatArray:
        """Return torques (n,) [Nm] by the environment on the joints, as of an instant [s]; NaN: there is no estimate.

        Where zeros are no wrench, they are no torques either: an arm that does not estimate them gives those.
        """
        ours = self._ours(now)
        return np.full(len(self._names), np.nan) if ours is None else ours
