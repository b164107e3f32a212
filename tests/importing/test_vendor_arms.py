"""Arms that users can obtain: the descriptions in the package example-robot-data, of the extra `meshes`."""

from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np
import pytest
from tests.importing.test_robot_import import assert_same_mechanics, stripped
from tests.needs import skip_for

from pretouch.importing.robot_import import ImportOptions, import_robot
from pretouch.sim.paper_scenes import placement_for

pytestmark = pytest.mark.slow


def robot(name: str) -> Path:
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        skip_for("make meshes")
    return Path(str(next(f for f in listed if f.as_posix().endswith(name)).locate()))


def test_a_panda_is_imported_as_ours_is(panda_model):
    found = import_robot(robot("panda_description/urdf/panda.urdf"), ImportOptions())
    assert max(body.sticks_out for body in found.bodies) < 0.03
    model = found.model
    for q in np.random.default_rng(0).uniform(panda_model.q_min, panda_model.q_max, (10, 7)):
        theirs, ours = model.kinematics(q), panda_model.kinematics(q)
        assert theirs.position[model.ee] == pytest.approx(ours.position[panda_model.ee], abs=1e-5)


@pytest.mark.parametrize(
    ("file", "joints", "ee", "scale"),
    [
        ("ur_description/urdf/ur5_robot.urdf", 6, "tool0", 1.0),
        ("xarm_description/urdf/xarm7.urdf", 7, "link_eef", 0.9),
        ("kinova_description/robots/kinova.urdf", 6, "j2s6s200_end_effector", 0.8),  # in COLLADA
    ],
)
def test_other_arms_are_imported_as_well_and_follow_the_papers_paths(file, joints, ee, scale):
    found = import_robot(robot(file), ImportOptions())
    assert found.model.n == joints
    assert found.model.description.ee_body == ee
    assert max(body.sticks_out for body in found.bodies) < 0.03
    assert not any("No posture was found" in remark for remark in found.remarks)
    assert_same_mechanics(found.model, stripped(robot(file)))
    assert placement_for(found.model).scale >= scale
