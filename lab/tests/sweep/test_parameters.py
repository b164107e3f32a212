from dataclasses import replace
from hashlib import sha256
from itertools import pairwise

from pretouch.profiles import profile
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sim.randomisation import drawn, world_set
from pretouch_lab.bench.dense_skin import UNITS, units_of
from pretouch_lab.sweep.measures import StaticScene
from pretouch_lab.sweep.parameters import built, skin_of, world_digest


def test_each_value_arrives_where_its_name_says():
    values = {
        "detect.f_base_n": 8.25, "detect.f_std_n": 1 / 3 + 1e-9, "approach.rows": "floor", "slow": "none",
        "plant.mass_error": 0.1, "plant.kind": "payload", "sensing.latency_s": 0.1, "sensing.rate_hz": 10.0,
        "skin.units": 3, "scene.side": "+y",
    }  # fmt: skip
    made = built("paper", StaticScene(), values, 1003)
    assert (made.profile.detect.f_base_n, made.profile.detect.f_std_n) == (8.25, 1 / 3 + 1e-9)
    assert made.profile.approach.rows == "floor"
    assert made.profile.slow is None
    assert (made.plant.mass_error, made.plant.payload_max_kg) == (0.1, 0.5)
    assert (made.sensing.latency_s, made.sensing.period_of(PAPER_SENSOR)) == (0.1, 0.1)
    assert (len(made.skin), made.scene.side, made.seed) == (3, "+y", 1003)


def test_nothing_varied_is_the_profile_and_the_arm_of_all_other_experiments():
    made = built("paper", StaticScene(), {}, 0)
    assert made.profile == profile("paper")
    assert len(made.skin) == 7
    assert made.sensing.period_of(PAPER_SENSOR) == 0.02


def test_a_world_draws_arm_and_sensors_under_what_is_varied(tmp_path):
    one = built("paper", StaticScene(), {"plant.world": "realistic", "plant.payload_max_kg": 0.3}, 1003)
    other = built("paper", StaticScene(), {"plant.world": "realistic"}, 1004)
    world = drawn(world_set("realistic"), 1003)
    assert one.plant == replace(world.plant, payload_max_kg=0.3)
    assert one.sensing == world.ranging
    assert one.plant.torque_offset_nm != other.plant.torque_offset_nm
    assert built("paper", StaticScene(), {"plant.world": "none"}, 1003) == built("paper", StaticScene(), {}, 1003)


def test_a_cell_knows_the_file_its_world_is_of(tmp_path):
    place = tmp_path / "arm.toml"
    place.write_text("[plant]\npayload_max_kg = 0.25\n")
    values = {"plant.world": str(place)}
    assert built("paper", StaticScene(), values, 0).plant.payload_max_kg == 0.25
    assert world_digest(values) == sha256(place.read_bytes()).hexdigest()
    assert world_digest({"plant.world": "none"}) is None


def test_more_units_are_those_of_fewer_and_others():
    counts = [units_of(n) for n in range(65)]
    assert counts[32] == UNITS
    assert counts[1]["hand"] == 1
    for n, (fewer, more) in enumerate(pairwise(counts)):
        assert sum(fewer.values()) == n
        assert all(more[name] >= fewer[name] for name in UNITS)


def test_sixty_four_units_find_their_places_and_three_are_among_them():
    few, many = skin_of(3), skin_of(64)
    places = {unit.id: unit.T_link_sensor.tolist() for unit in many.units}
    assert len(places) == 64
    assert all(places[unit.id] == unit.T_link_sensor.tolist() for unit in few.units)
