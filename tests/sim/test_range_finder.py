import numpy as np
import pytest
from tests.sim.ranging import CONE_MEAN, EXACT, FORWARD, NO_ERROR, Rig, ball, wall

from pretouch.perception.scene_filter import ray_capsule
from pretouch.sensing.sensor import Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders, RangeSample
from pretouch.sim.scene import Box, SceneSpec
from pretouch.types import RangeStatus


@pytest.mark.parametrize("distance", [0.06, 0.5, 1.2])
def test_a_wall_is_read_at_its_distance_on_average(rig, distance):
    readings = rig(wall(distance), units=30, offset_max_m=0.0).collect(1.0)
    assert len(readings["distance"]) > 1400
    assert np.all(readings["status"] == RangeStatus.OK)
    assert readings["distance"].mean() == pytest.approx(distance, abs=0.001)
    # standard deviation of a target that fills the cone: 3 mm and 6 mm a metre
    assert readings["distance"].std() == pytest.approx(0.003 + 0.006 * distance, rel=0.1)


def test_each_unit_has_its_own_constant_offset(rig):
    means = []
    for distance in (0.2, 0.8):
        readings = rig(wall(distance), units=30, noise_floor_m=0.0, noise_rate=0.0).collect(0.1)
        offset = readings["distance"] - distance
        assert np.abs(offset).max() <= 0.0105
        means.append([offset[readings["unit"] == unit].mean() for unit in range(30)])
    assert means[0] == pytest.approx(means[1], abs=5e-4)
    assert np.std(means[0]) == pytest.approx(0.01 / np.sqrt(3.0), rel=0.25)  # uniform


@pytest.mark.parametrize(("told", "rate"), [({}, 50.0), ({"rate_hz": 10.0}, 10.0)])
def test_units_measure_at_the_rate_of_their_type_or_as_told_each_at_its_own_phase(rig, told, rate):
    readings = rig(wall(0.5), units=10, **told, dropout=0.0, jitter_s=0.0).collect(3.0)
    phases = []
    for unit in range(10):
        stamps = readings["stamp"][readings["unit"] == unit]
        assert len(stamps) == pytest.approx(3.0 * rate, rel=0.05)
        assert np.diff(stamps) == pytest.approx(1.0 / rate, rel=0.15)
        phases.append(stamps[0])
    assert len(set(phases)) >= 5


@pytest.mark.parametrize(
    ("distance", "statuses"),
    [
        (0.1, {RangeStatus.MIN_RANGE}),
        (0.5, {RangeStatus.OK}),
        (1.5, {RangeStatus.OK}),
        (2.5, {RangeStatus.SIGMA}),
        (3.2, {RangeStatus.SIGNAL}),
    ],
)
def test_a_sensor_of_another_type_measures_at_its_own_rate_and_range(rig, distance, statuses):
    sonar = Sensor(field_of_view_deg=12.0, nearest_m=0.2, farthest_m=3.0, rate_hz=10.0, noise=2.0)
    readings = rig(wall(distance), units=30, sensor=sonar, offset_max_m=0.0, dropout=0.0).collect(1.0)
    assert len(readings["stamp"]) == pytest.approx(300, rel=0.1)
    assert set(readings["status"]) == statuses
    if statuses == {RangeStatus.OK}:
        assert readings["distance"].mean() == pytest.approx(distance, abs=0.01)
        assert readings["distance"].std() == pytest.approx(2.0 * (0.003 + 0.006 * distance), rel=0.15)


@pytest.mark.parametrize(
    ("distance", "status"),
    [(0.03, RangeStatus.MIN_RANGE), (0.05, RangeStatus.OK), (1.2, RangeStatus.OK), (1.35, RangeStatus.SIGNAL)],
)
def test_the_status_says_what_a_distance_is_worth(rig, distance, status):
    readings = rig(wall(distance), **EXACT).collect(0.4)
    assert len(readings["status"]) >= 2
    assert np.all(readings["status"] == status)


def test_readings_arrive_late_and_carry_the_instant_of_measurement(rig):
    readings = rig(wall(0.5), units=30).collect(1.0)
    delay = readings["seen"] - readings["stamp"]
    assert delay.min() >= 0.008 - 1e-9
    assert delay.mean() == pytest.approx(0.008 + 0.004 + 0.0005, abs=0.0005)  # seen at the next millisecond
    assert np.percentile(delay, 99) > 0.02


def test_the_stamp_is_when_the_target_was_at_the_distance(rig):
    bench = rig(hand=ball(0.6), rings=0, **EXACT)
    bench.plant.mj_data.qvel[-3] = -0.8
    readings = bench.collect(0.4)
    # a free hand at 0.8 m/s: between stamp and arrival it moves on by 10 mm
    assert readings["distance"] == pytest.approx(0.6 - 0.8 * readings["stamp"], abs=0.002)


def test_a_reading_is_held_until_the_next(rig):
    bench = rig(wall(0.5))
    before = bench.finders.read()
    assert before.stamp[0] == -np.inf
    assert before.status[0] == RangeStatus.NONE
    seen = bench.collect(0.5)["seen"]
    held = bench.finders.read()
    assert np.array_equal(held.distance, bench.finders.read().distance)
    assert np.diff(seen).min() > 0.004
    kept = held.distance.copy(), held.stamp.copy()
    bench.plant.advance(0.1)
    assert np.array_equal(held.distance, kept[0])
    assert np.array_equal(held.stamp, kept[1])
    assert bench.finders.read().stamp[0] > held.stamp[0]


def test_a_reading_that_was_overtaken_is_dropped(rig):
    bench, stamps = rig(wall(0.5), jitter_s=0.05), []
    for _ in range(1000):
        bench.plant.advance(0.001)
        stamps.append(bench.finders.read().stamp[0])
    assert np.all(np.diff(stamps[200:]) >= 0)
    assert len(set(stamps)) < 0.8 * 50, "nothing was overtaken"


@pytest.mark.parametrize("probability", [0.005, 0.2])
def test_readings_are_lost_at_the_dropout_rate(rig, probability):
    stamps = []
    for dropout in (0.0, probability):
        readings = rig(wall(0.5), units=40, dropout=dropout, jitter_s=1e-6).collect(1.0)
        stamps.append(set(zip(readings["unit"], readings["stamp"], strict=True)))
    sent, received = stamps
    assert received < sent
    lost, n = len(sent - received), len(sent)
    assert abs(lost - probability * n) < 4.0 * np.sqrt(n * probability * (1.0 - probability))


def test_a_silenced_unit_is_never_heard_again_and_the_others_are(rig):
    bench = rig(wall(0.5), units=3)
    bench.plant.advance(0.2)
    bench.finders.silenced.add(1)
    bench.plant.advance(0.1)  # what was under way arrives
    before = bench.finders.read().stamp
    bench.plant.advance(0.5)
    after = bench.finders.read().stamp
    assert after[1] == before[1] < 0.2
    assert np.all(after[[0, 2]] > 0.7)
    bench.finders.silenced.clear()
    bench.plant.advance(0.1)
    assert bench.finders.read().stamp[1] > 0.8


@pytest.mark.parametrize(("gap", "status"), [(0.1, RangeStatus.OK), (0.35, RangeStatus.OK), (1.0, RangeStatus.SIGNAL)])
def test_a_fist_is_seen_only_near(rig, gap, status):
    readings = rig(hand=ball(gap), **EXACT).collect(0.1)
    assert np.all(readings["status"] == status)
    if status == RangeStatus.OK:
        assert gap <= readings["distance"][0] < gap + 0.05


def test_a_hand_that_presses_on_the_sensor_is_at_no_distance(rig):
    readings = rig(hand=ball(-0.004), **EXACT).collect(0.1)
    assert np.all(readings["status"] == RangeStatus.MIN_RANGE)
    assert readings["distance"] == pytest.approx(0.0)


def test_of_two_objects_the_nearer_is_reported(rig):
    post = wall(0.4, "post", half_width=0.03)  # fills a tenth of the cone
    alone = rig(wall(0.9), **EXACT).collect(0.1)["distance"]
    both = rig(wall(0.9), post, **EXACT).collect(0.1)["distance"]
    assert alone == pytest.approx(0.9, abs=0.001)
    assert both == pytest.approx(0.4 / CONE_MEAN, abs=0.001)


def test_an_object_as_near_as_another_is_merged_with_it(rig):
    post = wall(0.4, "post", half_width=0.06)  # hides the wall from the axis and the six rays round it
    both = rig(wall(0.46), post, **EXACT).collect(0.1)["distance"]
    # 1 ray of 0.4 m, 6 of 0.4028 m, 12 of 0.4731 m, weighted by 6.25, 6.12, 4.345
    assert both == pytest.approx(0.4412 / CONE_MEAN, abs=0.0005)


def test_the_rest_of_the_arm_is_seen(rig, panda_model):
    back = np.diag([-1.0, -1.0, 1.0, 1.0]) @ FORWARD  # on the back of the hand, the beam towards the upper arm
    back[2, 3] = 0.03
    seen = rig(pose=back, rings=0, **EXACT).collect(0.1)
    kin, hand = panda_model.kinematics(panda_model.description.q_ready), panda_model.link_index("panda_hand")
    origin, beam = kin.position[hand] + kin.rotation[hand] @ back[:3, 3], kin.rotation[hand] @ back[:3, 2]
    body = panda_model.capsules
    ends = [(kin.position[k] + kin.rotation[k] @ a, kin.position[k] + kin.rotation[k] @ b, r)
            for k, a, b, r in zip(body.link, body.a, body.b, body.radius, strict=True) if k != hand]  # fmt: skip
    expected = min(ray_capsule(origin, beam, a, b, r) for a, b, r in ends)
    assert 0.3 < expected < 0.5
    assert seen["distance"] == pytest.approx(expected, abs=1e-4)


def test_a_unit_does_not_see_its_own_link(rig, panda_model):
    side = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.2], [0.0, 1.0, 0.0, 0.0469], [0.0, 0.0, 0.0, 1.0]])
    # 0.2 m beside the hand, looking at its side, 0.102 m from its middle
    assert np.all(rig(pose=side, rings=0, **EXACT).collect(0.1)["status"] == RangeStatus.SIGNAL)
    half = np.sqrt(0.5)  # the hand is turned by -45 degrees on the flange, 0.107 m from link 7
    T_7_hand = np.array([[half, half, 0.0, 0.0], [-half, half, 0.0, 0.0], [0.0, 0.0, 1.0, 0.107], [0.0, 0.0, 0.0, 1.0]])
    seen = rig(pose=T_7_hand @ side, link="panda_link7", rings=0, **EXACT).collect(0.1)
    assert np.all(seen["status"] == RangeStatus.OK)
    assert seen["distance"] == pytest.approx(0.098, abs=0.002)


def test_a_skin_without_units_reads_nothing(panda_model):
    plant = Plant(panda_model, SceneSpec(), NO_ERROR, panda_model.description.q_ready, seed=0)
    finders = RangeFinders(plant, Skin([], panda_model), RangeFinderParams(), seed=0)
    plant.advance(0.05)
    assert len(finders.read().stamp) == 0


# All that a sensor says, for whoever brings it somewhere


def sent(model, skin, duration: float, *boxes: Box, seed: int = 0, **params: object) -> list[RangeSample]:
    samples: list[RangeSample] = []
    plant = Plant(model, SceneSpec(boxes=boxes), NO_ERROR, model.description.q_ready, seed)
    finders = RangeFinders(plant, skin, RangeFinderParams(**params), seed, samples.append)
    plant.advance(duration)
    assert not np.isfinite(finders.read().stamp).any(), "what is sent elsewhere is not read here"
    return samples


def test_what_is_sent_is_what_would_have_been_read(panda_model, paper_skin, rig):
    at_once = {"latency_s": 0.0, "jitter_s": 1e-6, "dropout": 0.0}
    samples = sent(panda_model, paper_skin, 0.5, wall(0.5), **at_once)
    plant = Plant(panda_model, SceneSpec(boxes=(wall(0.5),)), NO_ERROR, panda_model.description.q_ready, 0)
    read = Rig(plant, RangeFinders(plant, paper_skin, RangeFinderParams(**at_once), 0), paper_skin).collect(0.5)
    told = sorted((s.unit, s.time, s.distance, s.status) for s in samples)
    seen = sorted(zip(*(read[key].tolist() for key in ("unit", "stamp", "distance", "status")), strict=True))
    assert len(told) >= len(seen) > 150
    assert set(seen) <= set(told)


def test_ambient_light_never_repeats_itself_and_is_all_that_there_is_without_a_target(panda_model):
    skin = Skin([SensorUnit("front", "panda_hand", FORWARD)], panda_model)
    for boxes, status in (((), RangeStatus.SIGNAL), ((wall(0.5),), RangeStatus.OK)):
        samples = sent(panda_model, skin, 1.0, *boxes)
        assert {s.status for s in samples} == {status}
        assert all((s.distance > 0.0) == (s.sigma > 0.0) == bool(boxes) for s in samples)
        assert np.mean([s.ambient for s in samples]) == pytest.approx(0.3, rel=0.01)
        assert len({round(s.ambient, 4) for s in samples}) > 20
