"""The benchmark of the control step: that its work is what it says, and that its numbers are those measured."""

import time
from itertools import count
from mmap import mmap

import numpy as np
import pytest

from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import at_rate, profile
from pretouch.robot.body import placed
from pretouch.robot.model import RobotModel
from pretouch.types import Inputs, Mode
from pretouch_lab.bench import cycle
from pretouch_lab.bench.cycle import CycleRequest, measure
from pretouch_lab.bench.workload import Workload

# a short window, so that the arm soon moves
SHORT = profile("paper:window.samples=10")
FAST = at_rate(SHORT, 1000.0)


@pytest.fixture(scope="module")
def work(panda_model: RobotModel) -> Workload:
    return Workload(panda_model, 128, FAST, 0)


def height(point: np.ndarray, a: np.ndarray, b: np.ndarray, radius: np.ndarray) -> float:
    """Distance of a point from the nearest of some capsules [m]."""
    axis = b - a
    along = np.clip(((point - a) * axis).sum(1) / (axis**2).sum(1), 0, 1)
    return float((np.linalg.norm(point - a - along[:, None] * axis, axis=1) - radius).min())


def test_units_sit_all_over_the_arm_and_look_away_from_it(panda_model: RobotModel, work: Workload):
    links = [panda_model.links[k] for k in work.skin.link]
    assert set(links) == {*(f"panda_link{i}" for i in range(2, 8)), "panda_hand"}
    assert max(map(links.count, set(links))) < 0.4 * len(links)
    for link, T in zip(work.skin.link, work.skin.T_link_sensor, strict=True):
        _, *own = panda_model.capsules.of_links(np.array([link]))
        assert 0.002 < height(T[:3, 3], *own) < 0.01
        assert height(T[:3, 3] + 0.02 * T[:3, 2], *own) > height(T[:3, 3], *own) + 0.005


def test_first_readings_end_on_the_spheres_or_the_wall(panda_model: RobotModel, work: Workload):
    inputs, kin = work.inputs(), panda_model.kinematics(panda_model.description.q_ready)
    R, T = kin.rotation[work.skin.link], work.skin.T_link_sensor
    origin = kin.position[work.skin.link] + (R @ T[:, :3, 3, None])[..., 0]
    points = origin + inputs.readings.distance[:, None] * (R @ T[:, :3, 2, None])[..., 0]
    to_sphere = np.linalg.norm(points[:, None] - work.spheres, axis=2) - 0.1
    to_wall = np.abs(np.linalg.norm(points - [0.25, 0.0, 0.45], axis=1) - 1.0)
    np.testing.assert_allclose(np.minimum(to_sphere.min(axis=1), to_wall), 0.0, atol=1e-9)
    assert np.all(to_sphere > -1e-9)
    assert np.mean(to_sphere.min(axis=1) < 1e-9) > 0.3


def test_a_seed_is_a_workload_of_any_arm(fr3_model: RobotModel):
    works = [Workload(fr3_model, 7, FAST, seed) for seed in (1, 1, 2)]
    assert {unit.link for unit in works[0].skin.units} <= {f"fr3_link{k}" for k in range(2, 9)} | {"fr3_hand"}
    first, again, other = (work.inputs() for work in works)
    assert np.isfinite(first.readings.distance).all()
    np.testing.assert_array_equal(first.readings.distance, again.readings.distance)
    np.testing.assert_array_equal(first.robot.wrench, again.robot.wrench)
    assert np.any(first.readings.distance != other.readings.distance)


@pytest.mark.parametrize(("points", "all_new"), [(7, True), (128, False)])
def test_the_arm_moves_restricted_and_never_touches(panda_model: RobotModel, points: int, all_new: bool):
    work = Workload(panda_model, points, FAST, 0, all_new)
    controller = Controller(panda_model, work.skin, no_fixtures(), work.path, FAST)
    state, steps, clear = controller.init(work.inputs().robot), [], []
    last, came = np.full(points, -np.inf), np.zeros(points)
    for _ in range(1500):
        inputs = work.inputs()
        fresh, last = inputs.readings.stamp > last, inputs.readings.stamp
        assert np.all(last <= inputs.stamp)
        came += fresh
        assert np.all(inputs.stamp - last <= (0.0 if all_new else 0.02 + 1e-9))
        step, state = controller.step(state, inputs)
        work.move(step.command)
        steps.append(step)
        _, *body = placed(panda_model.capsules, panda_model.kinematics(inputs.robot.q))
        clear.append(min(height(center, *body) for center in work.spheres) - 0.1)
    # 50 a second, in cycles of a millisecond
    assert set(came) == {1500} if all_new else set(came) <= {75, 76}
    settled = steps[600:]
    assert {step.mode for step in settled} == {Mode.TRACK}
    assert np.median([len(step.restricted) for step in settled]) > 0.5 * points
    assert np.median([len(step.obstacles.unit) for step in settled]) > 0.9 * points
    assert settled[-1].path_phase - settled[0].path_phase > 0.005
    assert min(clear) > 0.1
    assert all(step.contact is None for step in steps)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cycle, "profile", lambda _name: SHORT)
    monkeypatch.setattr(cycle, "_SETTLE", 20)


@pytest.mark.usefixtures("short")
def test_slow_steps_are_overruns_in_wall_time_alone(monkeypatch: pytest.MonkeyPatch):
    turns, step = count(1), Controller.step

    def slow(controller: Controller, state: object, inputs: Inputs) -> object:
        """One step in five waits, and so takes no processor time."""
        if next(turns) % 5 == 0:
            time.sleep(0.1)
        return step(controller, state, inputs)

    monkeypatch.setattr(Controller, "step", slow)
    monkeypatch.setattr(cycle, "_SETTLE", 0)
    monkeypatch.setattr(cycle, "warm_up", lambda *_given: None)
    row = measure(2, CycleRequest(rate_hz=25.0, cycles=10))
    assert row["overruns"] >= 2
    assert 100_000 <= row["wall_max_us"] < 5_000_000
    assert row["median_us"] < 100_000
    assert row["missed_ticks"] >= 1


@pytest.mark.usefixtures("short")
def test_memory_that_steps_keep_is_told(monkeypatch: pytest.MonkeyPatch):
    kept, step = [], Controller.step

    def hoarding(controller: Controller, state: object, inputs: Inputs) -> object:
        """Each step keeps a megabyte, of the system's: the process may have as much free of its own."""
        kept.append(mmap(-1, 2**20))
        kept[-1].write(bytes(2**20))
        return step(controller, state, inputs)

    assert measure(2, CycleRequest(cycles=30))["memory_gained_kib"] < 5_000
    monkeypatch.setattr(Controller, "step", hoarding)
    assert measure(2, CycleRequest(cycles=30))["memory_gained_kib"] >= 28 * 1024
