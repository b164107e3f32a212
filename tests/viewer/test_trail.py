from dataclasses import replace

import numpy as np
from tests.viewer.fake_scene import FakeScene

from pretouch.types import ControlStep, Mode
from pretouch.viewer.trail import BLOCK, BLOCKS, SPACING_M, Activity, Trail, activity


def at(step: ControlStep, x: float, **more: object) -> ControlStep:
    return replace(step, ee_position=np.array([x, 0.0, 0.0]), path_position=np.array([x, 0.0, 0.0]), **more)


def kept_off(step: ControlStep, held: bool) -> ControlStep:
    """A step 5 cm off the path, with one obstacle that restricts, and holds the arm or not."""
    n = len(step.q)
    qp = replace(step.qp, slack=np.zeros(1), multipliers=np.concatenate([np.zeros(n), [0.3 if held else 0.0]]))
    return replace(
        step,
        mode=Mode.TRACK,
        path_position=step.ee_position + np.array([0.0, 0.05, 0.0]),
        restricted=np.array([0]),
        qp=qp,
    )


def test_an_arm_on_its_path_follows_it(some_step: ControlStep) -> None:
    assert some_step.mode is Mode.TRACK
    assert activity(some_step) is Activity.FOLLOWING


def test_off_the_path_an_arm_avoids_while_an_obstacle_holds_it_and_then_recovers(some_step: ControlStep) -> None:
    assert activity(kept_off(some_step, held=True)) is Activity.AVOIDING
    assert activity(kept_off(some_step, held=False)) is Activity.RECOVERING


def test_a_violated_row_holds_too(some_step: ControlStep) -> None:
    step = kept_off(some_step, held=False)
    assert activity(replace(step, qp=replace(step.qp, slack=np.array([0.01])))) is Activity.AVOIDING


def test_reactions_and_holds_have_their_own_colours(some_step: ControlStep) -> None:
    for mode, expected in ((Mode.REACT, Activity.REACTING), (Mode.HOLD, Activity.HOLDING)):
        assert activity(replace(kept_off(some_step, held=True), mode=mode)) is expected
    assert len({kind.value for kind in Activity}) == len(Activity)


def test_a_trail_is_of_bounded_length(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(5000):
        trail.add(at(some_step, i * SPACING_M * 1.01))
        trail.draw(i / 100)
    assert len(scene.nodes) == BLOCKS
    assert BLOCK * (BLOCKS - 1) <= len(trail) <= BLOCK * BLOCKS
    furthest = max(node.points[:, 1, 0].max() for node in scene.nodes.values())
    nearest = min(node.points[:, 0, 0].min() for node in scene.nodes.values())
    np.testing.assert_allclose(furthest, 4999 * SPACING_M * 1.01, rtol=1e-6)
    assert furthest - nearest < BLOCK * BLOCKS * SPACING_M * 1.02


def test_a_trail_sends_only_its_newest_block_and_little(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(3000):
        trail.add(at(some_step, 0.003 * i))  # 0.3 m/s
        trail.draw(i / 100)
    assert scene.bytes_of("points", "colors") / 30.0 < 25_000
    points = [size for _, key, size in scene.sent if key == "points"]
    assert max(points) <= BLOCK * 2 * 3 * 4


def test_a_standing_arm_adds_nothing(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(1000):
        trail.add(at(some_step, 0.002 * (i % 2)))
        trail.draw(i / 100)
    assert len(trail) == 0
    assert scene.sent == []


def test_the_segments_of_a_trail_join(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(300):
        trail.add(at(some_step, 0.006 * i))
        trail.draw(i / 10)
    trail.draw(1000.0)
    points = np.concatenate([node.points for node in scene.nodes.values() if node.visible])
    np.testing.assert_array_equal(points[1:, 0], points[:-1, 1])
    assert len(points) == 299


def test_a_hidden_trail_stays_hidden_as_it_grows(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(200):
        trail.add(at(some_step, 0.006 * i))
        trail.draw(i / 10)
        if i == 50:
            trail.show(False)
    assert not any(node.visible for node in scene.nodes.values())
    trail.show(True)
    assert sum(node.visible for node in scene.nodes.values()) == 5


def test_a_cleared_trail_is_gone_and_begins_anew(some_step: ControlStep) -> None:
    scene = FakeScene()
    trail = Trail(scene)  # type: ignore[arg-type]
    for i in range(100):
        trail.add(at(some_step, 0.01 * i))
        trail.draw(float(i))
    trail.clear()
    assert not any(node.visible for node in scene.nodes.values())
    trail.add(at(some_step, 5.0))
    trail.add(at(some_step, 5.1))
    trail.draw(1000.0)
    assert len(trail) == 1
