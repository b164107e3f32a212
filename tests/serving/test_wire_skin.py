from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from tests.wire_skin import WireSkin

from pretouch.control.path import Circle
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.errors import HardwareError
from pretouch.loop import turn
from pretouch.profiles import Profile
from pretouch.serving.fleet import Fleet, FleetParams, simulated_keys
from pretouch.serving.network import NetworkParams, network
from pretouch.serving.unit import UnitParams
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, SceneSpec, fixtures
from pretouch.types import ControlStep, Mode, RangeStatus

WALL = Box("wall", (0.9, 0.0, 0.5), (0.05, 2.0, 2.0), 25_000.0)


@pytest.fixture
def plant(panda_model) -> Callable[..., Plant]:
    def made(*boxes: Box, seed: int = 0) -> Plant:
        start = brought_to(panda_model, Circle().point(0.0))
        return Plant(panda_model, SceneSpec(boxes=boxes), PlantParams(), start, seed)

    return made


def watched(plant: Plant, skin: WireSkin, duration: float) -> dict[str, np.ndarray]:
    """What `read` returned each 10 ms: stamps, distances and statuses (S, K), and when (S,)."""
    rows = []
    for _ in range(round(duration / 0.01)):
        plant.advance(0.01)
        readings = skin.read()
        rows.append((plant.time, readings.stamp, readings.distance, readings.status))
    return dict(zip(("time", "stamp", "distance", "status"), map(np.array, zip(*rows, strict=True)), strict=True))


def measured(plant: Plant, skin, seed: int = 0) -> list[tuple[int, float, float, int]]:
    """Unit, instant, distance and status of what the sensors measure, taken down at their side."""
    rows: list[tuple[int, float, float, int]] = []
    RangeFinders(plant, skin, RangeFinderParams(), seed, lambda s: rows.append((s.unit, s.time, s.distance, s.status)))
    return rows


def test_readings_are_those_measured_to_the_millimetre_and_never_taken_as_fresher(plant, paper_skin):
    arm = plant(WALL)
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), 0) as skin:
        true = measured(arm, paper_skin)
        told = watched(arm, skin, 3.0)
    seen = 0
    for unit in range(len(paper_skin)):
        mine = np.array([row[1:] for row in true if row[0] == unit])
        for stamp, distance, status in {
            (s, d, c)
            for s, d, c in zip(*(told[key][:, unit].tolist() for key in ("stamp", "distance", "status")), strict=True)
            if np.isfinite(s)
        }:
            # the stamp is the earliest it can be: at most what a beacon takes on its way before the truth
            at = np.searchsorted(mine[:, 0], stamp - 5e-6)
            assert mine[at, 0] - stamp < 0.006
            assert distance == pytest.approx(mine[at, 1], abs=0.51e-3)
            assert status == mine[at, 2]
            seen += 1
    assert seen > 800


def test_the_wire_is_deterministic_bit_for_bit(plant, paper_skin):
    runs = []
    for _ in range(2):
        arm = plant(WALL)
        params = FleetParams(network(loss=0.2, overtaken=0.1, doubled=0.1), imu=ImuParams(), reboot_every_s=3.0)
        with WireSkin(arm, paper_skin, RangeFinderParams(), params, 5) as skin:
            told = watched(arm, skin, 4.0)
            counted = [(u.accepted, u.lost, u.replayed, u.sessions, u.offset) for u in skin.receiver.units]
            imu = [(batch.unit, batch.index, batch.stamp.tobytes()) for batch in skin.receiver.take_imu()]
        runs.append((*(told[key].tobytes() for key in ("stamp", "distance", "status")), counted, imu))
    assert runs[0] == runs[1]


def test_another_seed_takes_another_course(plant, paper_skin):
    told = []
    for seed in (0, 1):
        arm = plant()
        with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), seed) as skin:
            told.append(watched(arm, skin, 0.5)["stamp"])
    assert not np.array_equal(*told)


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3])
def test_the_receiver_counts_what_the_network_lost(plant, paper_skin, loss):
    arm = plant()
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(network(loss)), 0) as skin:
        watched(arm, skin, 6.0)
        steady = [u for u in skin.receiver.units if u.sessions == 1]
        share = 1 - sum(u.accepted for u in steady) / sum(u.sample.sequence for u in steady)
    assert share == pytest.approx(loss, abs=0.03)
    assert len(steady) >= (5 if loss else 7)


def test_imu_samples_come_through_the_wire_in_their_own_time(plant, paper_skin):
    arm = plant()
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(imu=ImuParams()), 0) as skin:
        watched(arm, skin, 2.0)
        batches = [batch for batch in skin.receiver.take_imu() if batch.unit == 0]
    assert all(late.index == early.index + len(early.stamp) for early, late in pairwise(batches)), (
        "samples are missing between batches"
    )
    size = np.linalg.norm(np.vstack([batch.acceleration for batch in batches]), axis=1)
    assert size.mean() == pytest.approx(9.8, abs=1.0)
    assert len(size) == pytest.approx(1.86 * 416, rel=0.06)  # from the first session on
    stamps = np.concatenate([batch.stamp for batch in batches])
    assert np.diff(stamps).mean() == pytest.approx(1 / 416, rel=0.04)


def test_a_unit_whose_finder_stops_ages_though_it_goes_on_sending(plant, paper_skin):
    arm = plant()
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), 0) as skin:
        watched(arm, skin, 1.0)
        skin.range_finders.silenced = {2}
        told = watched(arm, skin, 1.0)
        assert skin.receiver.units[2].state == "live"
    age = told["time"] - told["stamp"].T
    assert age[2, -1] > 1.0
    assert np.delete(age, 2, axis=0).max() < 0.1


def test_a_unit_without_a_key_and_a_receiver_that_cannot_be_found_are_refused(paper_skin):
    keys = simulated_keys(paper_skin.ids, 0)
    with pytest.raises(HardwareError, match=r"No key for unit elbow"):
        Fleet(["elbow"], keys, FleetParams(), 0, ("127.0.0.1", 9))
    with pytest.raises(HardwareError, match=r"The receiver no.such.host.invalid:9 cannot be found"):
        Fleet(paper_skin.ids, keys, FleetParams(), 0, ("no.such.host.invalid", 9))
    with pytest.raises(HardwareError, match=r"port is 99999"):
        Fleet(paper_skin.ids, keys, FleetParams(), 0, ("127.0.0.1", 99999))


# The whole chain: a unit in trouble, the arm slows, holds with its name, and goes on


def ride(
    plant: Plant, model, skin, duration: float, events: dict[float, Callable[[Fleet, float], None]],
    net: NetworkParams | None = None,
) -> tuple[list[ControlStep], WireSkin]:  # fmt: skip
    """Follow the circle with the readings over the wire; what happens to the units when [s]."""
    params, left = FleetParams(net or NetworkParams(), UnitParams(boot_s=1.0)), dict(sorted(events.items()))
    controller = Controller(model, skin, fixtures(plant.scene), Circle(), Profile())
    with WireSkin(plant, skin, RangeFinderParams(), params, 0) as wire:
        plant.advance(0.2)
        clock, steps = PlantClock(plant, 0.01), []
        state = controller.init(plant.read())
        while plant.time < duration:
            while left and plant.time >= next(iter(left)):
                left.pop(next(iter(left)))(wire.fleet, plant.time)
            cycle = turn(controller, state, plant, wire, clock.tick())
            state = cycle.after
            steps.append(cycle.step)
    return steps, wire


def held(steps: list[ControlStep], since: float) -> list[ControlStep]:
    return [s for s in steps if s.mode is Mode.HOLD and s.stamp >= since]


def speeds(steps: list[ControlStep]) -> np.ndarray:
    return np.array([np.linalg.norm(s.desired_velocity) for s in steps])


def assert_no_jump(steps: list[ControlStep], model) -> None:
    """No rise of the speed asked for beyond 1 m/s^2, no change of a joint's command beyond its acceleration."""
    rises = np.diff(speeds(steps))
    assert rises.max() < 0.01 * 1.0 + 0.006, "position gain of the path included"
    commands = np.diff([s.command for s in steps], axis=0)
    assert (np.abs(commands) <= 0.01 * model.description.qdd_max + 1e-12).all()


def silence(fleet: Fleet, now: float) -> None:
    fleet.units[3].silent = True


def speak(fleet: Fleet, now: float) -> None:
    fleet.units[3].silent = False


def test_a_unit_that_goes_silent_stops_the_arm_with_its_name_and_lets_it_go_on_gently(plant, panda_model, paper_skin):
    steps, _ = ride(plant(), panda_model, paper_skin, 7.0, {3.0: silence, 4.0: speak})
    holds = held(steps, 2.0)
    assert 3.25 < holds[0].stamp < 3.45
    assert holds[-1].stamp < 4.2
    assert all(paper_skin.ids[3] in s.reason for s in holds)
    scale = {round(s.stamp, 2): s.speed_scale for s in steps}
    assert scale[3.0] == 1.0
    assert 0.0 < scale[3.2] < 1.0, "it does not slow before it holds"
    after = [s for s in steps if s.stamp > holds[-1].stamp]
    assert speeds(after)[0] < 0.02
    assert speeds(after)[-1] > 0.29
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)


def test_a_unit_that_is_stuck_stops_the_arm_though_it_says_it_is_fresh(plant, panda_model, paper_skin):
    def stick(fleet: Fleet, now: float) -> None:
        fleet.units[3].stuck = True

    def free(fleet: Fleet, now: float) -> None:
        fleet.units[3].stuck = False

    steps, wire = ride(plant(), panda_model, paper_skin, 8.0, {3.0: stick, 6.0: free})
    holds = held(steps, 2.0)
    assert 4.0 < holds[0].stamp < 4.6  # a second until it counts as stuck, 0.3 s without a telling reading
    assert 6.0 < holds[-1].stamp < 6.2
    assert all(f"{paper_skin.ids[3]} (it repeats the same reading)" in s.reason for s in holds)
    assert not wire.receiver.units[3].stuck
    after = [s for s in steps if s.stamp > holds[-1].stamp]
    assert speeds(after)[0] < 0.02
    assert speeds(after)[-1] > 0.29
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)


def test_a_unit_that_reboots_stops_the_arm_until_it_is_back_in_a_session(plant, panda_model, paper_skin):
    def reboot(fleet: Fleet, now: float) -> None:
        fleet.units[3].reboot(now)

    steps, wire = ride(plant(), panda_model, paper_skin, 7.0, {3.0: reboot})
    holds = held(steps, 2.0)
    assert 3.25 < holds[0].stamp < 3.45
    assert 4.0 < holds[-1].stamp < 4.4  # a second to boot, then hello, beacon, sample
    assert all(paper_skin.ids[3] in s.reason for s in holds)
    unit = wire.receiver.units[3]
    assert (unit.sessions, unit.reboots, unit.clock_jumps) == (2, 1, 0)
    assert speeds(steps)[-1] > 0.29
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)


def test_losses_doubles_and_overtaking_alone_stop_nothing(plant, panda_model, paper_skin):
    rough = network(loss=0.1, overtaken=0.05, doubled=0.1)
    steps, wire = ride(plant(), panda_model, paper_skin, 6.0, {}, rough)
    assert held(steps, 1.5) == []
    assert speeds(steps)[-1] > 0.29
    assert sum(unit.replayed for unit in wire.receiver.units) > 50, "doubled ones are refused"
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)


def test_a_status_of_a_silent_unit_stays_what_it_was(plant, panda_model, paper_skin):
    arm = plant()
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), 0) as skin:
        before = watched(arm, skin, 1.0)
        silence(skin.fleet, arm.time)
        after = watched(arm, skin, 1.0)
    assert before["status"][-1, 3] == after["status"][-1, 3] != RangeStatus.STUCK
