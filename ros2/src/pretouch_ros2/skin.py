"""The port `Skin` over ROS 2 topics of sensor_msgs/Range."""

import math
from functools import partial
from typing import Any

import numpy as np

from pretouch.errors import HardwareError
from pretouch.recording.viewer_topics import topic_name
from pretouch.sensing import skin as skins
from pretouch.types import RangeReadings, RangeStatus
from pretouch_ros2.messages import RANGE
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import check_topic
from pretouch_ros2.stamps import SourceStamps

_NOTHING = (-math.inf, 0.0, RangeStatus.NONE)
"""Stamp, distance and status of a unit that is not heard."""
RANGES = "/skin/{unit}/range"
"""Topic of each unit."""
_UNIT = "{unit}"
_FROZEN_S = 5.0
"""Time for which a value that repeats to the last digit may be chance [s]: some sensors round to centimetres."""
_UNKNOWN_MOST, _SHOWN = 64, 80
"""Names of other units that are kept, and their letters."""


class Ros2Skin:
    """Sensor units behind topics; a unit that is not heard is silent, which the controller names."""

    def __init__(self, skin: skins.Skin, node: Ros2Node, topic: str = RANGES, shared_clock: bool = False) -> None:
        """Take the units, the node, the topic of each, and whether stamps of headers count (see `ArmParams`).

        Without `{unit}` it is one topic for all, on which frame_id is the unit's id.
        """
        check_topic("Ros2Skin", "topic", topic.replace(_UNIT, "u"))
        self._ids, self._node, self._topic = skin.ids, node, topic
        self._stamps = [SourceStamps(shared_clock) for _ in skin.ids]
        self._newest: list[tuple[float, float, RangeStatus]] = [_NOTHING for _ in skin.ids]
        self._same: list[tuple[float, float]] = [(math.nan, 0.0) for _ in skin.ids]
        """Value of each unit, and since when it has not changed [s]."""
        self._unknown: set[str] = set()
        if _UNIT in topic:
            self._subscriptions = [
                node.subscribe(own, RANGE, partial(self._take, i)) for i, own in enumerate(self._topics())
            ]
        else:
            self._subscriptions = [node.subscribe(topic, RANGE, self._take_any)]

    def wait(self, timeout: float = 5.0) -> None:
        """Wait until each unit was heard, for so long at most [s]; those that were not are a HardwareError."""

        def silent() -> list[str]:
            return [name for name, (stamp, _, _) in zip(self._ids, self._newest, strict=True) if stamp == -math.inf]

        if not self._node.wait_for(lambda: not silent(), timeout):
            there = ", ".join(self._node.topics(RANGE)) or "none"
            beside = f", only from {', '.join(sorted(self._unknown))}" if self._unknown else ""
            raise HardwareError(
                f"No reading was received from {', '.join(silent())} on {self._topic}{beside}: set the"
                f" topic to fit those of sensor_msgs/Range ({there}). {' '.join(self.notes)}".strip()
            )

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the messages for a person, a sentence each."""
        sentences = [subscription.unreadable for subscription in self._subscriptions]
        for name, stamps in zip(self._ids, self._stamps, strict=True):
            several = f"Several publishers send as {name}: run only one; until then the unit is silent."
            sentences += [several if stamps.together() else stamps.not_newer(name)]
        for name, (value, since), (stamp, *_) in zip(self._ids, self._same, tuple(self._newest), strict=True):
            frozen = f"{name} has sent {value:g} m for {stamp - since:.0f} s: it is frozen, or that is its code for"
            sentences += [f"{frozen} nothing near, which REP 117 wants as +inf." if stamp - since > _FROZEN_S else ""]
        return tuple(filter(None, sentences))

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit, stamped with when it was received by the monotonic clock.

        A unit for which several publish is silent: nobody can say whose readings are its own.
        """
        newest = [_NOTHING if s.together() else one for s, one in zip(self._stamps, tuple(self._newest), strict=True)]
        stamp, distance, status = np.array(newest, dtype=np.float64).reshape(-1, 3).T.copy()
        return RangeReadings(stamp, distance, status.astype(np.int64))

    def _topics(self) -> list[str]:
        topics = [self._topic.replace(_UNIT, topic_name(name)) for name in self._ids]
        twice = {topic for topic in topics if topics.count(topic) > 1}
        if twice:
            raise HardwareError(f"Several units would share {', '.join(sorted(twice))}: give them different ids.")
        return topics

    def _take_any(self, message: Any, received: float, writer: int) -> None:
        name = message.header.frame_id
        if name in self._ids:
            self._take(self._ids.index(name), message, received, writer)
        elif len(self._unknown) < _UNKNOWN_MOST:
            self._unknown.add(name[:_SHOWN])

    def _take(self, unit: int, message: Any, received: float, writer: int) -> None:
        stamp = self._stamps[unit].instant(message.header, received, writer)
        if stamp is not None:
            value, status = float(message.range), status_of(message)
            if value != self._same[unit][0] or status is RangeStatus.SIGNAL or math.isinf(value):
                self._same[unit] = (value, stamp)
            self._newest[unit] = (stamp, value, status)


def status_of(message: Any) -> RangeStatus:
    """Return what a Range tells, by REP 117: from its farthest limit on there is nothing near, or it is too near.

    A message without a span to measure in, as of a switch, or with one in millimetres tells nothing.
    """
    distance, least, most = message.range, message.min_range, message.max_range
    in_mm = 100.0 < most < math.inf  # no sensor of an arm measures so far [m]
    if math.isnan(distance) or -math.inf < distance < 0 or not 0 <= least < most or in_mm:
        return RangeStatus.NONE
    if distance >= most:
        return RangeStatus.SIGNAL
    return RangeStatus.MIN_RANGE if distance < least else RangeStatus.OK
