from collections.abc import Callable

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.errors import HardwareError
from pretouch.loop import turn
from pretouch.profiles import Profile
from pretouch.robot.postures import brought_to
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import Box, SceneSpec, fixtures
from pretouch.types import ControlStep, Mode, RangeStatus
from pretouch.units.fleet import Fleet, FleetParams, NetworkParams, simulated_keys
from pretouch.units.simulated import UnitParams
from pretouch.units.wire import Flag
from tests.units.fake_unit import imu_taken
from tests.wire_skin import WireSkin, network

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


def test_the_wire_is_deterministic_bit_for_bit(plant, paper_skin):
    runs = []
    for seed in (5, 5, 6):
        arm = plant(WALL)
        params = FleetParams(network(loss=0.2, overtaken=0.1, doubled=0.1), imu=ImuParams(), reboot_every_s=1.5)
        with WireSkin(arm, paper_skin, RangeFinderParams(), params, seed) as skin:
            told = watched(arm, skin, 2.0)
            counted = [(u.accepted, u.lost, u.replayed, u.sessions, u.offset) for u in skin.receiver.units]
            imu = [(batch.unit, batch.index, batch.stamp.tobytes()) for batch in imu_taken(skin.receiver)]
        runs.append((*(told[key].tobytes() for key in ("stamp", "distance", "status")), counted, imu))
    assert runs[0] == runs[1]
    assert runs[0][0] != runs[2][0], "another seed takes another course"


def test_a_unit_whose_finder_stops_ages_though_it_goes_on_sending_and_a_silent_one_keeps_its_status(plant, paper_skin):
    arm = plant()
    with WireSkin(arm, paper_skin, RangeFinderParams(), FleetParams(), 0) as skin:
        before = watched(arm, skin, 1.0)
        skin.range_finders.silenced = {2}
        skin.fleet.units[3].silent = True
        told = watched(arm, skin, 1.0)
        assert skin.receiver.units[2].state == "live"
        assert skin.touch() is None
        assert not any(one.sample.flags & Flag.TOUCH or one.sample.touch for one in skin.receiver.take_samples())
    age = told["time"] - told["stamp"].T
    assert age[2:4, -1].min() > 1.0
    assert np.delete(age, [2, 3], axis=0).max() < 0.1
    assert before["status"][-1, 3] == told["status"][-1, 3] != RangeStatus.STUCK


def test_a_unit_without_a_key_and_a_receiver_that_cannot_be_found_are_refused(paper_skin):
    keys = simulated_keys(paper_skin.ids, 0)
    with pytest.raises(HardwareError, match=r"There is no key for elbow"):
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


def put(**what: bool) -> Callable[[Fleet, float], None]:
    """Have the fourth unit be silent or stuck, or no more."""
    return lambda fleet, now: [setattr(fleet.units[3], name, value) for name, value in what.items()]


@pytest.mark.parametrize(
    ("duration", "events", "first", "last", "said", "counts"),
    [
        # as long as a reading may be old
        (7.0, {3.0: put(silent=True), 4.0: put(silent=False)}, (3.25, 3.45), (4.0, 4.2), "", (1, 0, 0)),
        # a second until it counts as stuck, 0.3 s without a telling reading
        (8.0, {3.0: put(stuck=True), 6.0: put(stuck=False)}, (4.0, 4.6), (6.0, 6.2),
         " (it repeats the same reading)", (1, 0, 0)),
        # a second to boot, then hello, beacon, sample
        (7.0, {3.0: lambda fleet, now: fleet.units[3].reboot(now)}, (3.25, 3.45), (4.0, 4.4), "", (2, 1, 0)),
    ],
    ids=["silent", "stuck", "reboots"],
)  # fmt: skip
def test_a_unit_in_trouble_stops_the_arm_with_its_name_and_lets_it_go_on_gently(
    plant, panda_model, paper_skin, duration, events, first, last, said, counts
):
    steps, wire = ride(plant(), panda_model, paper_skin, duration, events)
    holds = held(steps, 2.0)
    assert first[0] < holds[0].stamp < first[1]
    assert last[0] < holds[-1].stamp < last[1]
    assert all(f"{paper_skin.ids[3]}{said}" in s.reason for s in holds)
    scale = {round(s.stamp, 2): s.speed_scale for s in steps}
    assert scale[3.0] == 1.0
    assert 0.0 < scale[round(holds[0].stamp - 0.05, 2)] < 1.0, "it does not slow before it holds"
    unit = wire.receiver.units[3]
    assert (unit.sessions, unit.reboots, unit.clock_jumps, unit.stuck) == (*counts, False)
    after = [s for s in steps if s.stamp > holds[-1].stamp]
    assert speeds(after)[0] < 0.02
    assert speeds(after)[-1] > 0.29
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)


def test_losses_doubles_and_overtaking_alone_stop_nothing(plant, panda_model, paper_skin):
    rough = network(loss=0.1, overtaken=0.05, doubled=0.1)
    steps, wire = ride(plant(), panda_model, paper_skin, 6.0, {}, rough)
    assert held(steps, 1.5) == []
    assert speeds(steps)[-1] > 0.29
    assert sum(unit.replayed for unit in wire.receiver.units) > 50, "doubled ones are refused"
    assert_no_jump([s for s in steps if s.stamp > 1.5], panda_model)
