"""What is caught between two links, or between one and a fixture, and what is only a push."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pretouch.contact.clamp import find_pinch, presses_on_fixture
from pretouch.contact.detector import Body
from pretouch.params import PinchParams
from pretouch.robot.body import Capsules, no_capsules, placed
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import nearest_points, segment_distance
from pretouch.sensing.skin import Skin
from pretouch.types import NOT_TOUCHED, FloatArray, Touched

P = PinchParams()
FOLDED = np.array([0.0, -1.2, 0.0, -2.95, 0.0, 1.75, 0.785])
"""Forearm and upper arm some 0.1 m apart."""
FOLDING = np.array([0.0, 0.0, 0.0, -0.3, 0.0, 0.0, 0.0])
NOISE = np.diag([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05]) ** 2
FLOOR = np.array([[0.0, 0.0, 1.0, -0.2]])


def beside(model: RobotModel, planes: FloatArray | None = None, standing: Capsules | None = None) -> Body:
    """The arm without a skin, beside fixtures."""
    return Body(model, Skin((), model), 0.01, np.zeros((0, 4)) if planes is None else planes, standing or no_capsules())


def gap_of(model: RobotModel, one: str, other: str, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where two links are nearest to each other, on the surface of each, and the unit vector across."""
    body, (_, a, b, _) = model.capsules, placed(model.capsules, model.kinematics(q))
    i, j = np.array(list(product(*(np.flatnonzero(body.link == model.link_index(link)) for link in (one, other))))).T
    least = np.argmin(segment_distance(a[i], b[i], a[j], b[j]) - body.radius[i] - body.radius[j])
    i, j = i[least], j[least]
    p, r = nearest_points(a[i], b[i], a[j], b[j])
    u = (r - p) / np.linalg.norm(r - p)
    return p + body.radius[i] * u, r - body.radius[j] * u, u


def squeezed(model: RobotModel, newtons: float, tilt: float = 0.0) -> FloatArray:
    """Torques of something between upper arm and forearm that pushes both apart."""
    kin = model.kinematics(FOLDED)
    at_upper, at_fore, u = gap_of(model, "panda_link2", "panda_link5", FOLDED)
    aside = np.cross(u, [0.0, 1.0, 0.0])
    force = newtons * (u + tilt * aside / np.linalg.norm(aside))
    J = [
        model.jacobian(kin, model.link_index(f"panda_{link}"), at)[:3]
        for link, at in (("link5", at_fore), ("link2", at_upper))
    ]
    return np.asarray((J[0] - J[1]).T @ force)


def found(model: RobotModel, torque: FloatArray, q: FloatArray = FOLDED, qd: FloatArray = FOLDING):
    return find_pinch(model, model.kinematics(q), torque, NOISE, qd, P)


MASS = '<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>'
ROD = '<geom type="capsule" fromto="{}" size=".02"/>'


@pytest.mark.parametrize(("joints", "caught"), [(2, False), (3, True)])
def test_between_base_and_second_link_nothing_is_looked_for(tmp_path: Path, joints: int, caught: bool) -> None:
    # the base has a rod 0.15 m from its axis, and the last link turns towards it: a gap of 2 cm closes at 0.1 m/s
    links = "".join(
        f'<body name="l{k}" pos="0 0 {0.2 * (k == 1)}">{MASS}<joint name="j{k}" axis="0 {k > 1:d} {k == 1:d}"'
        ' range="-3 3"/>' for k in range(1, joints + 1)
    )  # fmt: skip
    base = f'<body name="base">{ROD.format(".15 0 0 .15 0 .3")}{links}{ROD.format("0 0 0 .4 0 0")}'
    (tmp_path / "arm.xml").write_text(f"<mujoco><worldbody>{base}{'</body>' * (joints + 1)}</worldbody></mujoco>")
    one, rest = np.ones(joints), np.zeros(joints)
    model = RobotModel(RobotDescription("made", tmp_path / "arm.xml", f"l{joints}", one, one, one, rest, "made"))
    first = np.eye(joints)[0]
    pinch = find_pinch(model, model.kinematics(0.4 * first), 9.0 * first, np.eye(joints), -0.7 * first, P)
    assert (pinch is not None) is caught
    if pinch is not None:
        assert pinch[2] == pytest.approx(9.0 / 0.15, rel=0.1)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_what_pushes_upper_arm_and_forearm_apart_is_caught_between_them(panda_model: RobotModel, tilt: float) -> None:
    pinch = found(panda_model, squeezed(panda_model, 60.0, tilt))
    assert pinch is not None
    if not tilt:  # friction tilts the force
        assert [panda_model.links[link] for link in pinch[:2]] == ["panda_link2", "panda_link5"]
        assert pinch[2] == pytest.approx(60.0, rel=0.05)


@pytest.mark.parametrize(
    ("newtons", "q", "qd"),
    [
        (-60.0, FOLDED, FOLDING),  # pulls them together
        (60.0, FOLDED, -FOLDING),  # the arm was opening
        (60.0, FOLDED, np.zeros(7)),  # or stood
        (5.0, FOLDED, FOLDING),  # too weak
        (60.0, np.array([0.0, -0.3, 0.0, -1.2, 0.0, 1.2, 0.785]), FOLDING),  # the same torques of an arm stretched out
    ],
)
def test_what_is_not_caught(panda_model: RobotModel, newtons: float, q: FloatArray, qd: FloatArray) -> None:
    assert found(panda_model, squeezed(panda_model, newtons), q, qd) is None


def test_the_same_force_from_outside_is_a_push(panda_model: RobotModel) -> None:
    kin = panda_model.kinematics(FOLDED)
    _, at, u = gap_of(panda_model, "panda_link2", "panda_link5", FOLDED)
    J = panda_model.jacobian(kin, panda_model.link_index("panda_link5"), at)[:3]
    assert found(panda_model, J.T @ (60.0 * u)) is None


def test_noise_alone_is_nothing(panda_model: RobotModel) -> None:
    rng = np.random.default_rng(1009)
    assert all(found(panda_model, np.sqrt(np.diag(NOISE)) * rng.standard_normal(7)) is None for _ in range(50))


# between a link and a fixture


def down(model: RobotModel, speed: float) -> FloatArray:
    """Joint velocities with which the hand goes down [m/s]."""
    kin = model.kinematics(model.description.q_ready)
    return np.asarray(np.linalg.pinv(model.ee_jacobian(kin)) @ np.array([0.0, 0.0, -speed, 0.0, 0.0, 0.0]))


def touch(model: RobotModel, force: tuple[float, float, float]) -> Touched:
    """A contact at the end of the hand."""
    kin = model.kinematics(model.description.q_ready)
    return Touched(
        np.array([model.ee]), kin.position[model.ee][None].copy(), np.array([force]), np.array([0.01]), np.array([0.9])
    )


def under(model: RobotModel, gap: float) -> FloatArray:
    """A floor that far under the end of the hand."""
    height = model.kinematics(model.description.q_ready).position[model.ee][2] - gap
    return np.array([[0.0, 0.0, 1.0, height]])


@pytest.mark.parametrize(
    ("force", "gap", "speed", "is_pressed"),
    [
        ((0.0, 0.0, 30.0), 0.1, 0.1, True),
        ((5.0, 0.0, 30.0), 0.1, 0.1, True),
        ((0.0, 0.0, 30.0), 0.1, -0.1, False),  # the hand goes up
        ((0.0, 0.0, 30.0), 0.1, 0.0, False),  # or stands
        ((30.0, 0.0, 0.0), 0.1, 0.1, False),  # from the side
        ((0.0, 0.0, -30.0), 0.1, 0.1, False),  # from above
        ((0.0, 0.0, 5.0), 0.1, 0.1, False),  # too weak
        ((0.0, 0.0, 30.0), 0.3, 0.1, False),  # room for anybody
        ((0.0, 0.0, 30.0), 0.005, 0.1, False),  # the floor itself
    ],
)
def test_what_is_pressed_on_a_floor(
    panda_model: RobotModel, force: tuple[float, float, float], gap: float, speed: float, is_pressed: bool
) -> None:
    kin = panda_model.kinematics(panda_model.description.q_ready)
    qd, floor = down(panda_model, speed), under(panda_model, gap)
    assert presses_on_fixture(beside(panda_model, floor), kin, touch(panda_model, force), qd, P) == is_pressed


def test_what_is_pressed_on_a_post(panda_model: RobotModel) -> None:
    kin = panda_model.kinematics(panda_model.description.q_ready)
    x, y, z = kin.position[panda_model.ee]
    lying = Capsules(
        np.zeros(1, np.int64), np.array([[x, y - 1, z - 0.2]]), np.array([[x, y + 1, z - 0.2]]), np.full(1, 0.1)
    )
    up, qd = touch(panda_model, (0.0, 0.0, 30.0)), down(panda_model, 0.1)
    assert presses_on_fixture(beside(panda_model, standing=lying), kin, up, qd, P)
    aside = touch(panda_model, (30.0, 0.0, 0.0))
    assert not presses_on_fixture(beside(panda_model, standing=lying), kin, aside, qd, P)
    assert not presses_on_fixture(beside(panda_model), kin, up, qd, P)


def test_an_arm_that_is_not_touched_presses_nothing(panda_model: RobotModel) -> None:
    kin = panda_model.kinematics(panda_model.description.q_ready)
    assert not presses_on_fixture(beside(panda_model, FLOOR), kin, NOT_TOUCHED, down(panda_model, 0.1), P)
