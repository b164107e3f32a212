"""Publishing and subscribing: who comes late, who comes again, who is there, and how long a message takes."""

from threading import Event
from time import monotonic, monotonic_ns, sleep, time
from typing import Any

import numpy as np
import pytest
from ros2.tests.asking import joint_state, measured_range

from pretouch.errors import HardwareError, RobotError
from pretouch_ros2.messages import JOINT_STATE, RANGE, TEXT, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, NodeParams, seconds
from pretouch_ros2.robot import Ros2Robot
from pretouch_ros2.skin import Ros2Skin


def text(node: Ros2Node, said: str) -> Any:
    return node.messages.make(TEXT, said)


def test_who_comes_late_is_told_what_was_latched_and_nothing_else(node, other):
    node.publisher("/latched", TEXT, latched=True, depth=1).publish(text(node, "first"))
    node.publisher("/passing", TEXT).publish(text(node, "gone"))
    received, came = [], Event()

    def take(message: Any, *_: object) -> None:
        received.append(message.data)
        came.set()

    passing = other.subscribe("/passing", TEXT, take, reliable=True)
    assert other.wait_for(lambda: passing.publishers == 1, 10)
    other.subscribe("/latched", TEXT, take, reliable=True, latched=True)
    assert came.wait(10)
    assert received == ["first"]


def test_a_publisher_that_is_closed_is_gone_and_is_heard_again_when_it_comes_again(node, domain):
    received: list[tuple[str, int]] = []
    subscription = node.subscribe("/again", TEXT, lambda message, _, writer: received.append((message.data, writer)))
    for said in ("one", "two"):
        with Ros2Node(NodeParams(domain=domain)) as passing:
            publisher = passing.publisher("/again", TEXT)
            assert passing.wait_for(lambda publisher=publisher: publisher.subscribers == 1, 10)
            publisher.publish(text(passing, said))
            assert node.wait_for(lambda said=said: received[-1:] != [] and received[-1][0] == said, 5)
        assert publisher.topic == "/again"  # kept, but of no use
        assert node.wait_for(lambda: subscription.publishers == 0, 10)
    assert [said for said, _ in received] == ["one", "two"]
    assert received[0][1] != received[1][1]


def test_topics_of_others_are_listed_by_type(node, other):
    other.publisher("/arm/joint_states", JOINT_STATE)
    other.publisher("/arm/wrench", WRENCH)
    other.subscribe("/arm/commands", TEXT, lambda *_: None)
    assert node.wait_for(lambda: node.topics(TEXT, subscribed=True) == ("/arm/commands",), 10)
    assert node.wait_for(lambda: node.topics(JOINT_STATE) == ("/arm/joint_states",), 5)
    assert other.topics(JOINT_STATE) == ()


def test_an_arm_that_is_not_there_is_named_with_what_there_is(node, other, panda_model):
    with Ros2Robot(ArmParams("on-robot", "base"), panda_model, node) as robot:
        states = other.publisher("/elsewhere", JOINT_STATE)
        assert node.wait_for(lambda: node.topics(JOINT_STATE) == ("/elsewhere",), 10)
        with pytest.raises(
            RobotError, match=r"Nothing was received on /joint_states: .* set joint_states to one of /elsewhere"
        ):
            robot.wait(0.0)
        states = other.publisher("/joint_states", JOINT_STATE)
        assert node.wait_for(lambda: states.subscribers == 1, 10)
        states.publish(joint_state(1, ["fr3_joint1", *panda_model.joints[1:]], *np.zeros((2, 7))))
        with pytest.raises(RobotError, match=r"/joint_states has no panda_joint1: set joint_names to .* fr3_joint1"):
            robot.wait(0.5)
        states.publish(joint_state(2, panda_model.joints, *np.zeros((2, 7))))
        with pytest.raises(
            RobotError, match=r"Nothing was received on /wrench: .*none yet.*geometry_msgs/WrenchStamped"
        ):
            robot.wait(0.5)
        with pytest.raises(RobotError, match="one for each of panda_joint1, "):
            Ros2Robot(ArmParams("on-robot", "base", joint_names=("a",)), panda_model, node)
        with pytest.raises(RobotError, match=r"hold_s is 0.05 s: give at least the control period, 0.1 s"):
            Ros2Robot(ArmParams("on-robot", "base"), panda_model, node, 0.1)


def test_units_that_are_not_there_are_named(node, other, paper_skin):
    units = Ros2Skin(paper_skin, node, "/ranges")
    publisher = other.publisher("/ranges", RANGE)
    assert other.wait_for(lambda: publisher.subscribers == 1, 10)
    for name in [*paper_skin.ids[1:], "stranger"]:
        publisher.publish(measured_range(1, name, 0.5))
    with pytest.raises(
        HardwareError, match=rf"No reading was received from {paper_skin.ids[0]} on /ranges, only from stranger"
    ):
        units.wait(1.0)
    readings = units.read()
    assert readings.stamp[0] == -np.inf
    assert np.isfinite(readings.stamp[1:]).all()
    assert (readings.distance[1:] == 0.5).all()


def test_a_unit_for_which_several_publish_is_silent_and_named_and_strangers_take_little_memory(
    node, other, third, paper_skin
):
    def say(by: Ros2Node, name: str, number: int, distance: float) -> None:
        publishers[by].publish(measured_range(number, name, distance))

    ours = paper_skin.ids[0]
    units = Ros2Skin(paper_skin, node, "/ranges")
    publishers = {by: by.publisher("/ranges", RANGE) for by in (other, third)}
    assert all(by.wait_for(lambda one=one: one.subscribers == 1, 10) for by, one in publishers.items())
    say(other, ours, 1, 0.25)
    assert node.wait_for(lambda: units.read().distance[0] == 0.25, 5)
    assert units.notes == ()
    for number in range(2, 5):
        say(other, ours, number, 0.25)
        say(third, ours, number, 3.0)
    assert node.wait_for(lambda: units.read().stamp[0] == -np.inf, 5)
    assert units.notes == (f"Several publishers send as {ours}: run only one; until then the unit is silent.",)
    for number in range(100):
        say(other, f"{number}" + 1000 * "x", number, 0.5)
    say(other, paper_skin.ids[1], 1000, 0.5)
    assert node.wait_for(lambda: units.read().distance[1] == 0.5, 5)
    assert len(units._unknown) <= 64
    assert max(map(len, units._unknown)) <= 80


def test_a_unit_that_repeats_one_value_is_named_and_one_with_nothing_near_is_not(node, other, paper_skin):
    units = Ros2Skin(paper_skin, node, "/ranges", shared_clock=True)
    publisher, now = other.publisher("/ranges", RANGE), time()
    assert other.wait_for(lambda: publisher.subscribers == 1, 10)
    coded, zero, empty, alive = paper_skin.ids[:4]
    for ago in (20.0, 10.0):
        publisher.publish(measured_range(now - ago, coded, 8.19, most=10.0))
        publisher.publish(measured_range(now - ago, zero, 0.0, least=0.0))
        publisher.publish(measured_range(now - ago, empty, 4.0))
        publisher.publish(measured_range(now - ago, alive, 0.5 + 0.01 * ago))
    assert node.wait_for(lambda: len(units.notes) == 2, 5)
    named = [note.partition(":")[0] for note in units.notes]
    assert named == [f"{coded} has sent 8.19 m for 10 s", f"{zero} has sent 0 m for 10 s"]


@pytest.mark.slow
@pytest.mark.alone
def test_joint_states_at_1_khz_come_in_time(node, other):
    late: list[float] = []

    def take(message: Any, received: float, _: int) -> None:
        late.append(received - seconds(message.header.stamp.sec, message.header.stamp.nanosec))

    node.subscribe("/fast", JOINT_STATE, take)
    publisher, make = other.publisher("/fast", JOINT_STATE), other.messages.make
    assert other.wait_for(lambda: publisher.subscribers == 1, 10)
    names, zeros, begin = [f"panda_joint{i}" for i in range(1, 8)], np.zeros(7), monotonic()
    for i in range(5000):
        sleep(max(begin + i / 1000 - monotonic(), 0))
        header = other.messages.header(divmod(monotonic_ns(), 10**9), "")
        publisher.publish(make(JOINT_STATE, header, names, zeros, zeros, zeros))
    sleep(0.1)
    assert len(late) > 4500
    # the latency of a machine that does nothing else is 0.2 ms; nothing waits for a buffer to fill
    assert np.median(late) < 5e-3
