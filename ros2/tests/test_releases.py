"""What a joint_trajectory_controller of each release asks the arm for by our commands, in simulated time.

Velocities of up to 0.8 rad/s that turn around within 1.6 rad/s^2 use 0.213 of the smallest acceleration limit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ros2.tests.spline import Release, Spline

from pretouch.errors import RobotError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_ros2.inputs import JointReading
from pretouch_ros2.messages import WireMessages
from pretouch_ros2.params import ArmParams
from pretouch_ros2.trajectory_commands import TrajectoryCommands, parts_of_day

MODEL = RobotModel(panda())
A, V, Q = MODEL.description.qdd_max, MODEL.description.qd_max, MODEL.description.q_ready
MESSAGES = WireMessages("jazzy")
PARAMS = ArmParams("on-robot", "base")
PERIOD = 0.01
SETTLED = 1.0
"""When a course begins [s]."""
OWN = 0.25
MOVES = SETTLED - 0.1
JITTER = 1.3e-3 + 2e-3 * np.random.default_rng(0).random(1000)
"""Time from each turn until its message is there [s]."""
RELEASES = ("humble", "4.17", "4.21")


def swing(time: float) -> np.ndarray:
    """Velocities of 0.8 rad/s that turn around, each joint at another time."""
    return 0.8 * np.sin(2.0 * time + np.arange(7)) * min(1.0, time)


def still(_: float) -> np.ndarray:
    return np.zeros(7)


@dataclass
class Course:
    """Drives a simulated controller; `asked` has the positions at each of its periods."""

    release: Release
    wish: Callable[[float], np.ndarray]
    """Velocities (7,) [rad/s] by the time since `SETTLED` [s]."""
    until: float
    """End [s]."""
    rate: float = 1000.0
    params: ArmParams = PARAMS
    lag: float = 0.0
    """How far the arm is behind its controller [s]."""
    lost: Callable[[float], bool] = lambda _: False
    """Whether what is sent at an instant does not arrive."""
    off: tuple[float, float, np.ndarray | None] = (np.inf, np.inf, None)
    """While the controller is switched off, and where the arm is put meanwhile."""
    skew: float = 0.0
    """How far the controller's clock is ahead [s]."""
    wish_from: float = SETTLED

    def __post_init__(self) -> None:
        """Turn both."""
        self.tripped, self.messages = "", 0
        self.asked: list[np.ndarray] = []
        sent: list[Any] = []
        publisher = SimpleNamespace(publish=sent.append)
        node: Any = SimpleNamespace(messages=MESSAGES, publisher=lambda *_: publisher)
        commands = TrajectoryCommands(self.params, MODEL, list(MODEL.joints), node, PERIOD)
        controller = Spline(self.release, 1 / self.rate, list(MODEL.joints), Q)
        sec, nanosec = parts_of_day(0.0)
        mail: list[tuple[float, Any]] = []
        qd, turn = np.zeros(7), 0
        self.times = np.arange(0.0, self.until, 1 / self.rate) + 0.3 / self.rate
        for now in self.times:
            while (begin := turn * PERIOD) <= now and not self.tripped:
                wanted = self.wish(begin - SETTLED) if begin >= self.wish_from else np.zeros(7)
                qd = qd + np.clip(wanted - qd, -A * PERIOD * 0.9, A * PERIOD * 0.9)
                self._tick(commands, begin, qd)
                if not self.lost(begin):
                    mail += [(begin + JITTER[turn], message) for message in sent]
                self.messages += len(sent)
                sent.clear()
                turn += 1
            mail.sort(key=lambda each: each[0])
            is_off = self.off[0] <= now < self.off[1]
            while mail and mail[0][0] <= now:
                message = mail.pop(0)[1]
                if not is_off:
                    controller.take(message, sec + nanosec / 1e9 + self.skew)
            if is_off:
                q = self.asked[-1] if self.off[2] is None else self.off[2]
                controller.restart(q)
            else:
                q = controller.update(now)
            self.asked.append(np.array(q))

    def _tick(self, commands: TrajectoryCommands, now: float, qd: np.ndarray) -> None:
        back = round(self.lag * self.rate) + 1
        joints = JointReading(now, self.asked[-back] if len(self.asked) >= back else Q, np.zeros(7))
        if not commands.begun:
            commands.begin(joints, now)
        try:
            commands.check(joints, now)
        except RobotError as error:
            self.tripped = str(error)
            return
        commands.send(qd, now)

    def speed(self) -> np.ndarray:
        """Velocities between the positions asked for [rad/s]."""
        return np.diff(np.array(self.asked), axis=0) * self.rate

    def acceleration(self, begin: float = 0.0) -> float:
        """Largest acceleration from the positions asked for since an instant [s], in limits."""
        found = np.abs(np.diff(self.speed(), axis=0) * self.rate / A).max(axis=1)
        return float(found[self.times[2:] >= begin].max())


@pytest.mark.parametrize(
    "about",
    [
        *({"release": release, "rate": rate} for release in RELEASES for rate in (1000, 250, 100)),
        *({"skew": skew} for skew in (-0.01, -0.005, 0.003, 0.005)),  # clocks may differ by milliseconds
        *({"lag": lag} for lag in (0.01, 0.03)),  # and an arm may be behind its commands
    ],
)
def test_with_one_clock_messages_leave_no_trace_in_the_motion(about):
    course = Course(**{"release": "4.21", **about}, wish=swing, until=3.0)
    assert not course.tripped
    assert course.acceleration(MOVES) < OWN
    assert np.abs(course.speed()).max() > 0.75


@pytest.mark.parametrize(("release", "low", "high"), [("4.17", 0.0, 1.0), ("humble", 50, 200), ("4.21", 50, 200)])
def test_without_one_clock_some_releases_jerk_at_each_message(release, low, high):
    course = Course(release, swing, 3.0, params=replace(PARAMS, shared_clock=False))
    assert low < course.acceleration(MOVES) < high


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("length", [0.1, 0.15, 0.22, 0.5])
def test_after_lost_commands_the_arm_comes_to_rest_within_its_limits(release, length):
    course = Course(release, swing, 4.0, lost=lambda t: 2.1 <= t < 2.1 + length)
    assert course.tripped.startswith("The arm does not follow")
    assert course.acceleration() < 1.01
    assert not np.abs(course.speed()[-500:]).max() > 1e-9


@pytest.mark.parametrize(("length", "acceleration"), [(0.02, 25), (0.05, 250)])
def test_a_few_lost_commands_are_a_step_within_the_velocity_limits(length, acceleration):
    course = Course("4.21", swing, 4.0, lost=lambda t: 2.1 <= t < 2.1 + length)
    assert not course.tripped
    assert 1 < course.acceleration(MOVES) < acceleration
    assert (np.abs(course.speed()) < V).all()


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize("away", [0.01, 0.03, 0.045])
def test_an_arm_moved_by_hand_while_its_controller_was_off_stays_there_and_moves_from_there(release, away):
    course = Course(release, lambda t: swing(t - 3.0) if t > 3.0 else still(t), 6.0, off=(2.0, 2.5, Q + away))
    time = course.times[1:]
    assert not course.tripped
    assert np.abs(course.speed()[(time > 2.502) & (time < SETTLED + 3.0)]).max() < 1e-9
    assert course.acceleration(2.51) < OWN
    assert np.abs(course.speed()[time > 5.0]).max() > 0.5


def test_an_arm_moved_by_hand_too_far_is_told_of():
    course = Course("4.21", still, 3.0, off=(2.0, 2.5, Q + 0.06))
    assert "but was commanded to" in course.tripped
    after = course.times[1:] > 2.502
    assert np.abs(course.speed()[after]).max() < 1e-9


def test_a_controller_switched_off_in_motion_does_not_jump_when_it_is_back():
    course = Course("4.21", swing, 4.0, off=(2.0, 2.04, None))
    assert course.tripped
    assert course.acceleration(2.043) < 1.0


def test_at_rest_nothing_is_sent_and_no_motion_before_the_arm_has_settled():
    assert Course("4.21", still, 3.0).messages == 1
    early = Course("4.21", lambda t: np.full(7, 0.1), PARAMS.settle_s, wish_from=0.0)
    assert early.messages == 1
    assert np.abs(early.speed()).max() < 1e-12
