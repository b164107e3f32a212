"""A limb in the crook of an arm that folds, or on a floor on which the hand comes down, in the closed loop."""

from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
import pytest

from pretouch.control.path import WayPoints
from pretouch.explanation import resumable
from pretouch.modes import Event
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, nearest_points
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import HandGoal
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import FloatArray, Mode
from pretouch_lab.trial import Setup, play

pytestmark = pytest.mark.slow
SEED, SPEED_M_S = 1001, 0.1

PLACES = {
    "crook": np.array([[0.45, 0.0, 0.5], [0.3, 0.0, 0.22]]),
    "floor": np.array([[0.5, 0.0, 0.15], [0.5, 0.0, -0.15]]),
}
"""The path to and fro at each place [m]: at its end forearm and upper arm are 0.08 m apart, fingers are 0.05 m above
the floor."""
_ASIDE_M, _RADIUS_M = 0.004179898822221975, 0.05120731203806578
"""How far the limb, as thick as a forearm, lies from the middle of the gap along the axis about which the arm folds, or
of the fingers, and its radius [m]."""
_RESTS_N = 15.0
"""Largest force with which the person keeps it there [N]."""
_END_S = 9.0


@dataclass
class _Limb:
    """Lies where the person means to keep it, and measures what it is squeezed with."""

    place: str
    model: RobotModel
    force: list[float] = field(default_factory=list)
    """The smaller of the forces from both sides at each physics step [N]."""

    def middle(self, position: FloatArray, rotation: FloatArray) -> FloatArray:
        """Where it lies (3,) [m], given all links' origins and orientations."""
        aside = np.array([0.0, _ASIDE_M, 0.0])
        if self.place == "floor":
            return aside + np.array([*PLACES["floor"][0, :2], SceneSpec().floor_height + _RADIUS_M])
        name, body = self.model.description.name, self.model.capsules
        first, second = (np.flatnonzero(body.link == self.model.link_index(f"{name}_{link}")) for link in _CROOK)
        a, b = (
            position[body.link] + np.einsum("cij,cj->ci", rotation[body.link], end) for end in (body.a, body.b)
        )  # fmt: skip
        p, q = nearest_points(a[first, None], b[first, None], a[None, second], b[None, second])
        gap = np.linalg.norm(q - p, axis=2) - body.radius[first, None] - body.radius[None, second]
        i, j = np.unravel_index(gap.argmin(), gap.shape)
        way = (q[i, j] - p[i, j]) / np.linalg.norm(q[i, j] - p[i, j])
        return np.asarray(p[i, j] + (body.radius[first[i]] + 0.5 * gap[i, j]) * way + aside)

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return where the person means to keep it."""
        return HandGoal(self.middle(plant.link_position, plant.link_rotation), _RESTS_N)

    def attach(self, plant: Plant, _: object) -> None:
        """Measure before each physics step."""
        mj, data, wrench = plant.mj_model, plant.mj_data, np.zeros(6)
        limb, other_side = mj.geom("hand").id, self.model.link_index(f"{self.model.description.name}_{_CROOK[0]}")
        if self.place == "floor":
            other_side = int(mj.geom_bodyid[mj.geom("floor").id])

        def measure(_: float) -> None:
            sides = [0.0, 0.0]
            for i in range(data.ncon):
                contact = data.contact[i]
                if limb in (contact.geom1, contact.geom2):
                    other = contact.geom1 if contact.geom2 == limb else contact.geom2
                    mujoco.mj_contactForce(mj, data, i, wrench)
                    sides[int(mj.geom_bodyid[other]) == other_side] += float(wrench[0])
            self.force.append(min(sides))

        plant.before_each_step(measure)


_CROOK = ("link2", "link5")
"""Upper arm and forearm."""


def pinched(model: RobotModel, skin: Skin, place: str, name: str):
    """Return the force (T,) [N] with which the limb is squeezed at each millisecond, and the trial's record."""
    limb, used = _Limb(place, model), profile(name)
    kin = model.kinematics(brought_to(model, PLACES[place][0]))
    x, y, z = limb.middle(kin.position, kin.rotation).tolist()
    scene = SceneSpec(hand=HandSpec(radius=_RADIUS_M, stiffness=40_000.0, mass=2.0, start=(x, y, z)))
    used = replace(used, task=replace(used.task, speed_m_s=SPEED_M_S))
    path = WayPoints(PLACES[place], closed=True)
    record = play(
        Setup(model, skin, used, scene, path, SEED, hand=limb, prepare=limb.attach),
        lambda step, _: step.stamp >= _END_S,
    )
    return np.array(limb.force), record


def recognised(record) -> bool:
    return any(step.event in (Event.OPENING, Event.CLAMPED) for step in record.steps)


@pytest.mark.parametrize("place", PLACES)
def test_the_arm_says_what_it_caught_opens_and_holds(panda_model: RobotModel, paper_skin: Skin, place: str) -> None:
    force, record = pinched(panda_model, paper_skin, place, "pretouch")
    squeezed, last = force > TOUCH_N, record.steps[-1]
    assert 0.0 < squeezed.sum() / 1000.0 < 1.0
    assert recognised(record)
    assert last.mode is Mode.HOLD
    assert resumable(last)
    assert len(record.reactions()) == 1
    end = record.true_force[record.true_time > record.true_time[-1] - 1.0]
    assert np.linalg.norm(end, axis=1).max() < 1.0  # nothing is squeezed any more


def test_without_the_switch_it_is_a_push(panda_model: RobotModel, paper_skin: Skin) -> None:
    force, record = pinched(panda_model, paper_skin, "crook", "pretouch:react.pinch=none")
    assert (force > TOUCH_N).any()
    assert not recognised(record)
