"""What is published of the controller's steps, and that the control loop does not wait for it."""

from collections import defaultdict
from time import perf_counter, sleep
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.following_arm import DT, Arm

from pretouch.loop import Cycle
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch_ros2.messages import CLOUD, DIAGNOSTICS, STATUS, TEXT, TRANSFORMS, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.output import Ros2Output

TOPICS = {
    "/pretouch/obstacles": CLOUD, "/pretouch/force": WRENCH, "/pretouch/contact": WRENCH, "/pretouch/mode": TEXT,
    "/pretouch/limited": STATUS, "/diagnostics": DIAGNOSTICS, "/tf_static": TRANSFORMS,
}  # fmt: skip
LATCHED = ("/pretouch/mode", "/tf_static")


class Listener:
    """Keeps what is published on each of the topics."""

    def __init__(self, node: Ros2Node) -> None:
        self.received: dict[str, list[Any]] = defaultdict(list)
        self.node = node
        self.subscriptions = {
            topic: node.subscribe(topic, kind, lambda message, *_, topic=topic: self.received[topic].append(message),
                                  reliable=True, latched=topic in LATCHED)
            for topic, kind in TOPICS.items()
        }  # fmt: skip

    def last(self, topic: str) -> Any:
        assert self.node.wait_for(lambda: bool(self.received[topic]), 5), topic
        return self.received[topic][-1]


class Published(Arm):
    """An arm that follows its commands, whose turns are published."""

    def __init__(self, model: RobotModel, skin: Skin, node: Ros2Node) -> None:
        super().__init__(model, skin)
        self.output = Ros2Output(self.controller, node)

    def turn(self, *given: Any, **more: Any) -> Cycle:
        cycle = super().turn(*given, **more)
        self.output.record(cycle)
        return cycle


@pytest.fixture
def listener(other):
    return Listener(other)


@pytest.fixture
def published(panda_model, paper_skin, node, listener):
    published = Published(panda_model, paper_skin, node)
    # what is sent before both sides have found each other is lost
    assert listener.node.wait_for(lambda: all(one.publishers for one in listener.subscriptions.values()), 10)
    assert node.wait_for(lambda: all(publisher.subscribers for publisher in node._publishers), 10)
    yield published
    published.output.close()


def test_a_step_is_published_by_standard_messages(published, listener, panda_model, paper_skin):
    for _ in range(3):
        cycle = published.turn((1.0, 2.0, 3.0), {0: 0.4, 2: 0.3})
        sleep(0.05)
    step = cycle.step
    assert len(step.obstacles.unit) == 2
    cloud = listener.last("/pretouch/obstacles")
    assert [(f.name, f.offset, f.datatype) for f in cloud.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("distance", 12, 7), ("unit", 16, 6), ("age", 20, 7),
    ]  # fmt: skip
    rows = np.frombuffer(cloud.data.tobytes(), "<f4").reshape(cloud.width, 6)
    assert (cloud.width, cloud.point_step, cloud.row_step) == (2, 24, 48)
    assert rows[:, :3] == pytest.approx(step.obstacles.point, abs=1e-6)
    assert rows[:, 3] == pytest.approx(step.obstacles.body_distance, abs=1e-6)
    assert rows[:, 4].copy().view("<u4").tolist() == step.obstacles.unit.tolist()
    assert rows[:, 5] == pytest.approx(step.obstacles.age, abs=1e-6)
    force = listener.last("/pretouch/force")
    assert (force.header.frame_id, force.wrench.force.z) == (panda_model.links[0], 3.0)
    assert listener.last("/pretouch/mode").data.startswith("HOLD: Measuring the arm's torques")
    limited = listener.last("/pretouch/limited")
    assert {pair.key: pair.value for pair in limited.values} == {
        "by": "hold", "share": "0.000", "unit": "", "link": "", "joint": "",
    }  # fmt: skip
    assert (limited.level, limited.message) == (1, step.reason)


def test_units_lie_where_the_skin_has_them(published, listener, paper_skin):
    units = listener.last("/tf_static").transforms
    assert [t.child_frame_id for t in units] == list(paper_skin.ids)
    assert [t.header.frame_id for t in units] == [unit.link for unit in paper_skin.units]
    for unit, T_link_sensor in zip(units, paper_skin.T_link_sensor, strict=True):
        p, r = unit.transform.translation, unit.transform.rotation
        assert [p.x, p.y, p.z] == pytest.approx(T_link_sensor[:3, 3], abs=1e-9)
        assert Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix() == pytest.approx(T_link_sensor[:3, :3], abs=1e-9)


def test_each_contact_and_each_change_of_the_mode_is_published(published, listener):
    for _ in range(105):
        published.turn()
    cycle = published.turn((0.0, 40.0, 0.0))
    contacts = int(cycle.step.contact is not None)
    for _ in range(60):
        contacts += published.turn((0.0, 40.0, 0.0)).step.contact is not None
    assert contacts == 1
    assert listener.last("/pretouch/contact").wrench.force.y > 10
    modes = ["HOLD", "TRACK", "REACT"]
    assert listener.node.wait_for(
        lambda: [m for m in modes if any(t.data.startswith(m) for t in listener.received["/pretouch/mode"])] == modes, 5
    )
    sleep(0.1)
    assert len(listener.received["/pretouch/contact"]) == 1


def test_a_silent_unit_is_an_error_in_the_diagnostics(published, listener, paper_skin):
    published.turn(silent={1: 0.5, 2: 0.2})
    first, *units = listener.last("/diagnostics").status
    assert first.name == "pretouch: controller"
    assert (first.level, first.message.split(":")[0]) == (1, "HOLD")
    assert [unit.level for unit in units][:4] == [0, 2, 1, 0]
    assert [unit.hardware_id for unit in units] == list(paper_skin.ids)
    assert units[1].message == "received 0.50 s ago"


def test_steps_are_published_at_their_own_rate(published, listener):
    for _ in range(50):
        published.turn()
        sleep(DT)
    published.output.close()
    assert 5 <= len(listener.received["/pretouch/force"]) <= 25
    assert published.output.dropped == 0


@pytest.mark.slow
@pytest.mark.alone
def test_recording_a_step_takes_the_loop_little_time(published):
    took = []
    for _ in range(100):
        cycle = published.turn()
        begin = perf_counter()
        published.output.record(cycle)
        took.append(perf_counter() - begin)
        sleep(DT)
    assert np.median(took) < 0.3e-3


def test_the_last_steps_are_published_before_the_end(published, listener):
    published.turn()
    published.output.close()
    assert listener.last("/pretouch/mode").data.startswith("HOLD")


def test_a_failure_of_the_publishing_thread_is_told_and_keeps_nothing_waiting(published, monkeypatch):
    def fail(*_: object) -> None:
        raise ValueError("no cloud")

    monkeypatch.setattr(published.output._step_messages, "cloud", fail)
    assert published.output.notes == ()
    published.turn()
    published.output._thread.join(5)
    assert published.output.notes == ("Publishing control steps failed: ValueError: no cloud",)
    for _ in range(40):
        published.turn()
    assert published.output._queue.qsize() == 0
    assert published.output.dropped == 0
