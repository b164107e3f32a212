"""A participant in DDS that publishes and subscribes as a node of ROS 2 does."""

from collections.abc import Callable
from contextlib import suppress
from threading import Lock, Thread
from time import monotonic, sleep
from typing import Any, Self
from uuid import UUID

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import (
    DDSException,
    GuardCondition,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from pretouch.errors import RobotError
from pretouch_ros2.messages import WireMessages
from pretouch_ros2.network import participant
from pretouch_ros2.params import NodeParams

OnMessage = Callable[[Any, float, int], None]
"""Is told a message, when it was received by this machine's monotonic clock [s], and who wrote it."""
_DEPTH = 10
_BLOCKED_MS = 10
"""Longest time a reliable publisher may wait for a slow subscriber [ms]; keeping the last ten, it does not."""
_ANY = ViewState.Any | InstanceState.Any | SampleState.Any
_UNREAD = ViewState.Any | InstanceState.Any | SampleState.NotRead
_POLL_S = 0.02


def _count(matched: Callable[[], list[int]]) -> int:
    """Count those on the other side. cyclonedds asks twice, and stumbles over one that came in between."""
    while True:
        with suppress(IndexError):
            return len(matched())


class Publisher:
    """Publishes messages of one type on one topic."""

    def __init__(self, kind: str, topic: str, writer: DataWriter[Any], messages: WireMessages) -> None:
        self.kind, self.topic = kind, topic
        self._writer, self._messages = writer, messages

    def publish(self, message: Any) -> None:
        """Send a message; a RobotError if DDS cannot."""
        sample = object.__new__(self._messages.wire_type(self.kind))
        sample.cdr = self._messages.encoded(self.kind, message)
        try:
            self._writer.write(sample)
        except DDSException as error:
            raise RobotError(f"Publishing on {self.topic} failed ({error}): restart the program.") from error

    def close(self) -> None:
        """Leave the topic; nothing can be published any more."""
        del self._writer

    @property
    def key(self) -> UUID:
        """Key by which others know it."""
        return self._writer.guid

    @property
    def subscribers(self) -> int:
        """Number of subscribers."""
        return _count(self._writer.get_matched_subscriptions)


class Subscription:
    """Hands on what is published on one topic, in the node's own thread."""

    def __init__(
        self, kind: str, topic: str, reader: DataReader[Any], messages: WireMessages, on_message: OnMessage
    ) -> None:
        self.kind, self.topic = kind, topic
        self._reader, self._messages, self._on_message = reader, messages, on_message
        self.ready = ReadCondition(reader, _ANY)
        self._count, self._unreadable = 0, ""

    def take(self) -> None:
        """Hand on what has come."""
        received = monotonic()
        for sample in self._reader.take(_DEPTH):
            if isinstance(sample, InvalidSample):
                continue
            try:
                message = self._messages.decoded(self.kind, sample.cdr)
            except RobotError as error:
                self._unreadable = f"{self.topic}: {error}"
                continue
            self._count, self._unreadable = self._count + 1, ""
            self._on_message(message, received, sample.sample_info.publication_handle)

    def close(self) -> None:
        """Leave the topic."""
        del self.ready, self._reader

    @property
    def unreadable(self) -> str:
        """Reason why the newest message could not be read, as a sentence, or ''."""
        if self._unreadable or self._count or not self.publishers:
            return self._unreadable
        # cyclonedds drops what is too short for its type by itself, and only prints a line
        return (
            f"{self.topic} is published, but no message is a {self.kind} of {self._messages.distribution}: choose the"
            " sender's distribution."
        )

    @property
    def publishers(self) -> int:
        """Number of publishers."""
        return _count(self._reader.get_matched_publications)


class Ros2Node:
    """A participant: a context manager, with a thread of its own that receives."""

    def __init__(self, params: NodeParams) -> None:
        """Join a domain. A RobotError says what keeps it from that."""
        self.params = params
        self.messages = WireMessages(params.distribution)
        self._participant = participant(params)
        self._topics: dict[tuple[str, str], Topic[Any]] = {}
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._lock = Lock()
        self._ends = GuardCondition(self._participant)
        self._waits = WaitSet(self._participant)
        self._waits.attach(self._ends)
        self._ended = False
        self.failure = ""
        """Reason why nothing is received any more, as a sentence, or ''."""
        self._publications: dict[UUID, str] = {}
        self._discovered = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._discovery = ReadCondition(self._discovered, _UNREAD)
        self._waits.attach(self._discovery)
        self._thread = Thread(target=self._receive, name="ros2", daemon=True)
        self._thread.start()

    def publisher(self, topic: str, kind: str, *, latched: bool = False, depth: int = _DEPTH) -> Publisher:
        """Publish on a topic: reliable, the last `depth` kept, for who comes later too if it is `latched`."""
        qos = self._qos(kind, reliable=True, latched=latched, depth=depth)
        result = Publisher(kind, topic, DataWriter(self._participant, self._topic(topic, kind), qos), self.messages)
        self._publishers.append(result)
        return result

    def subscribe(
        self, topic: str, kind: str, on_message: OnMessage, *, reliable: bool = False, latched: bool = False
    ) -> Subscription:
        """Have messages handed on; best effort, so that publishers of sensor data match as others do."""
        qos = self._qos(kind, reliable=reliable, latched=latched, depth=_DEPTH)
        reader = DataReader(self._participant, self._topic(topic, kind), qos)
        subscription = Subscription(kind, topic, reader, self.messages, on_message)
        with self._lock:
            self._subscriptions.append(subscription)
        self._waits.attach(subscription.ready)
        return subscription

    def topics(self, kind: str, *, subscribed: bool = False) -> tuple[str, ...]:
        """Names of the topics of a type that others publish, or subscribe to, sorted."""
        builtin = BuiltinTopicDcpsSubscription if subscribed else BuiltinTopicDcpsPublication
        type_name = self.messages.wire_type(kind).__idl_typename__
        there = BuiltinDataReader(self._participant, builtin).read(1000)
        ours = self._participant.guid
        names = {e.topic_name for e in there if getattr(e, "type_name", "") == type_name and e.participant_key != ours}
        return tuple(sorted(name.removeprefix("rt") for name in names if name.startswith("rt/")))

    def others(self, publisher: Publisher) -> int:
        """Count who else publishes on a publisher's topic: one that was killed is only missed after 10 s."""
        there = self._publications  # replaced as a whole by the node's thread
        return sum(topic == f"rt{publisher.topic}" and key != publisher.key for key, topic in there.items())

    def wait_for(self, there: Callable[[], bool], timeout: float) -> bool:
        """Wait until something is there, for so long at most [s]; say whether it is."""
        end = monotonic() + timeout
        while not (is_there := there()) and monotonic() < end:
            sleep(_POLL_S)
        return is_there

    def close(self) -> None:
        """Leave the domain."""
        if self._ended:
            return
        self._ended = True
        self._ends.set(True)
        self._thread.join()
        # cyclonedds ends what is no longer referred to: readers and writers before what they stand on
        del self._waits, self._ends, self._discovery, self._discovered
        for publisher in self._publishers:
            publisher.close()
        for subscription in self._subscriptions:
            subscription.close()
        self._topics.clear()
        del self._participant

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _topic(self, name: str, kind: str) -> Topic[Any]:
        if (name, kind) not in self._topics:
            self._topics[name, kind] = Topic(self._participant, f"rt{name}", self.messages.wire_type(kind))
        return self._topics[name, kind]

    def _qos(self, kind: str, *, reliable: bool, latched: bool, depth: int) -> Qos:
        sure = Policy.Reliability.Reliable(duration(milliseconds=_BLOCKED_MS))
        policies = [
            sure if reliable else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
            Policy.History.KeepLast(depth),
            Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
            Policy.Userdata(f"typehash={self.messages.store.hash_rihs01(kind)};".encode()),
        ]
        if latched:
            policies.append(Policy.DurabilityService(0, Policy.History.KeepLast(depth), -1, -1, -1))
        return Qos(*policies)

    def _receive(self) -> None:
        try:
            while not self._ended:
                self._waits.wait(duration(seconds=1))
                if self._discovery.triggered:
                    self._publications = {
                        publication.key: publication.topic_name
                        for publication in self._discovered.read(1000)
                        if publication.sample_info.instance_state == InstanceState.Alive
                    }
                with self._lock:
                    subscriptions = tuple(self._subscriptions)
                for subscription in subscriptions:
                    subscription.take()
        except Exception as error:  # whoever reads next is told, and stops the arm
            self.failure = f"Receiving from ROS 2 failed ({type(error).__name__}: {error}): restart the program."
