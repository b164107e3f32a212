"""Units that disagree with the model: misplaced, swapped."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec
from pretouch.types import RangeReadings, RangeStatus
from pretouch.units.watch import ModelCheck

UNIT = 0
FAR = 0.4


@pytest.fixture
def q(panda_model):
    return panda_model.description.q_ready


@pytest.fixture
def wall(panda_model, paper_skin, q):
    """A plane across the beam of the first unit, 0.4 m before it."""
    return wall_before(panda_model, paper_skin, q, FAR)


def wall_before(model, skin, q, distance):
    position, rotation, _ = placed_sensors(skin.arrays, model.kinematics(q))
    beam = rotation[UNIT][:, 2]
    return Fixtures(np.array([[*-beam, -beam @ (position[UNIT] + distance * beam)]]), no_fixtures().capsules)


def readings(count, stamp, distance, status=RangeStatus.OK):
    """The first unit reports this; the others have failed."""
    distances, statuses = np.zeros(count), np.full(count, RangeStatus.HARDWARE, dtype=np.int64)
    distances[UNIT], statuses[UNIT] = distance, status
    return RangeReadings(np.full(count, stamp), distances, statuses)


def checked(model, skin, fixtures, reports, postures):
    check = ModelCheck(model, skin, fixtures)
    for i, ((distance, status), q) in enumerate(zip(reports, postures, strict=True)):
        check.take(q, readings(len(skin), 0.02 * i, distance, status))
    return check.findings()


@pytest.mark.parametrize(
    ("report", "words"),
    [((0.9, RangeStatus.OK), "reports 0.90 m where"), ((0.0, RangeStatus.SIGNAL), "reports nothing where")],
)
def test_a_unit_that_does_not_see_what_it_must_is_named(panda_model, paper_skin, wall, q, report, words):
    (finding,) = checked(panda_model, paper_skin, wall, [report] * 100, [q] * 100)
    assert (finding.unit, finding.level, finding.what) == (paper_skin.ids[UNIT], "fault", "model")
    assert words in finding.sentence
    assert "a fixture at 0.40 m, in 100 of 100 readings" in finding.sentence


@pytest.mark.parametrize(
    "reports",
    [
        [(0.41, RangeStatus.OK)] * 100,  # as predicted
        [(0.2, RangeStatus.OK)] * 100,  # an obstacle is before it
        [(0.9, RangeStatus.OK)] * 99,  # too few to say
        [(0.9, RangeStatus.OK), (0.4, RangeStatus.OK)] * 60,  # now and then
        [(0.0, RangeStatus.HARDWARE)] * 200,  # another trouble
    ],
)
def test_a_unit_that_may_be_right_is_not_named(panda_model, paper_skin, wall, q, reports):
    assert checked(panda_model, paper_skin, wall, reports, [q] * len(reports)) == ()


def test_a_fixture_out_of_reach_need_not_be_seen(panda_model, paper_skin, q):
    wall = wall_before(panda_model, paper_skin, q, 0.7)
    assert checked(panda_model, paper_skin, wall, [(0.0, RangeStatus.SIGNAL)] * 200, [q] * 200) == ()


def test_the_same_reading_counts_once(panda_model, paper_skin, wall, q):
    check = ModelCheck(panda_model, paper_skin, wall)
    for _ in range(200):
        check.take(q, readings(len(paper_skin), 1.0, 0.9))
    assert check.findings() == ()


def simulated(model, worn, thought, q):
    """What a check says of units that are worn in one way, and thought to be in another."""
    plant = Plant(model, SceneSpec(), PlantParams(), q, seed=0)
    finders = RangeFinders(plant, worn, RangeFinderParams(), 0)
    check = ModelCheck(model, thought, no_fixtures())
    for _ in range(250):
        plant.advance(0.01)
        check.take(q, finders.read())
    return check.findings()


def test_swapped_units_of_a_simulated_arm_are_found_by_what_they_see_of_the_arm(panda_model, paper_skin, q):
    assert simulated(panda_model, paper_skin, paper_skin, q) == ()
    units = list(paper_skin.units)
    front, back = (next(i for i, u in enumerate(units) if u.id == name) for name in ("hand_front", "hand_back"))
    units[front], units[back] = (
        replace(units[front], T_link_sensor=units[back].T_link_sensor),
        replace(units[back], T_link_sensor=units[front].T_link_sensor),
    )
    swapped = Skin(units, panda_model)
    told = simulated(panda_model, paper_skin, swapped, q)
    assert [f.unit for f in told] == ["hand_front"]  # it is thought to be where the arm is in view
    assert "reports" in told[0].sentence
