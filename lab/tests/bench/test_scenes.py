import shutil

import numpy as np
import pytest

from pretouch.errors import ExperimentError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin
from pretouch_lab.bench.dense_skin import UNITS, spread_skin
from pretouch_lab.bench.scenes import FOLDER, checksums, scenario, scenario_path, seed_of


def test_every_scenario_file_has_the_checksum_it_was_fixed_with():
    files = sorted(path.name for path in FOLDER.glob("*.toml"))
    assert sorted(checksums()) == files
    for name in files:
        scenario_path(name)


def test_a_scenario_file_that_was_changed_or_that_nobody_fixed_is_refused(tmp_path):
    shutil.copytree(FOLDER, tmp_path / "scenarios")
    file = tmp_path / "scenarios" / "free.toml"
    file.write_text(file.read_text().replace("full = 10", "full = 11"))
    with pytest.raises(ExperimentError, match=r"free\.toml was changed.*put the file back\.$"):
        scenario("free", tmp_path / "scenarios")
    assert scenario("contacts", tmp_path / "scenarios") == scenario("contacts")
    with pytest.raises(ExperimentError, match=r"rest\.toml has no checksum"):
        scenario("rest")


def test_seeds_come_from_the_range_and_no_farther():
    free = scenario("free")
    assert [seed_of(free, "published", n) for n in (0, 999)] == [4000, 4999]
    assert seed_of(free, "development", 3) == 1003
    with pytest.raises(ExperimentError, match="no seed number 1000"):
        seed_of(free, "published", 1000)


def test_the_dense_skin_of_the_scenarios_is_the_one_that_is_made():
    model = RobotModel(panda())
    made, kept = spread_skin(model, 32), load_skin(scenario_path("dense_skin.toml"), model)
    assert made.ids == kept.ids
    assert len(made) == sum(UNITS.values()) == 32
    np.testing.assert_allclose(made.T_link_sensor, kept.T_link_sensor, atol=1e-9)


def test_free_motion_at_the_goal_s_speed_is_long_enough_to_show_that_the_goal_is_reached():
    free, goal = scenario("free"), scenario("contacts")["goal"]
    arms = [arm for arm in free["arm"] if arm["kind"] == "nominal" and arm["speed_m_s"] == goal["speed_m_s"]]
    hours = sum(arm["full"] for arm in arms) * free["duration"]["full_s"] / 3600
    assert 3.689 / hours <= goal["false_alarms_per_hour"]  # chi-squared with two degrees: 97.5 % are below 7.378
