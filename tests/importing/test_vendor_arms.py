"""Arms that users can obtain: the descriptions in the package example-robot-data, of the extra `meshes`."""

from dataclasses import replace
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np
import pytest
from tests.importing.test_robot_import import assert_same_mechanics, stripped
from tests.needs import skip_for

from pretouch.importing.body import whole_arm_error
from pretouch.importing.capsule_fit import Rods
from pretouch.importing.robot_import import ImportOptions, _checked_at, import_robot
from pretouch.robot.body import Capsules


def robot(name: str) -> Path:
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        skip_for("make meshes")
    return Path(str(next(f for f in listed if f.as_posix().endswith(name)).locate()))


@pytest.fixture(scope="module")
def panda_import():
    return import_robot(robot("panda_description/urdf/panda.urdf"), ImportOptions())


def of(capsules: Capsules, link: int) -> Rods:
    own = capsules.of_links(np.array([link]))
    return Rods(own.a, own.b, own.radius)


@pytest.mark.slow
def test_the_pandas_capsules_are_no_worse_than_ours(panda_import, panda_model):
    arm = panda_import.arm
    both = [body for body in panda_import.bodies if arm.source.links[body.link].name in panda_model.links]
    shipped = [
        replace(body, rods=of(panda_model.capsules, panda_model.link_index(arm.source.links[body.link].name)))
        for body in both
    ]
    places = _checked_at(arm, panda_import.model)
    fitted, ours = (whole_arm_error(arm, tuple(bodies), *places) for bodies in (both, shipped))
    assert len(both) == 9  # all but the fingers, which ours has as one capsule of the hand
    assert fitted.rms < ours.rms
    assert fitted.p95 - fitted.p5 < 0.012
    assert abs(fitted.largest) < 0.03


@pytest.mark.slow
def test_the_pandas_poses_are_those_of_our_model(panda_import, panda_model):
    found = panda_import.model
    for q in np.random.default_rng(0).uniform(panda_model.q_min, panda_model.q_max, (10, 7)):
        theirs, ours = found.kinematics(q), panda_model.kinematics(q)
        assert theirs.position[found.ee] == pytest.approx(ours.position[panda_model.ee], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "joints", "ee"),
    [("ur_description/urdf/ur5_robot.urdf", 6, "tool0"), ("xarm_description/urdf/xarm7.urdf", 7, "link_eef")],
)
def test_other_arms_are_imported_as_well(file, joints, ee):
    found = import_robot(robot(file), ImportOptions())
    assert found.model.n == joints
    assert found.description.ee_body == ee
    assert found.error.p5 > -0.015
    assert found.error.p95 < 0.010
    assert_same_mechanics(found.model, stripped(robot(file)))
