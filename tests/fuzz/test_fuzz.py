"""Anything goes in, and what must hold holds: some steps by default, half a million in the slow suite."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.modes import Event
from pretouch.perception.scene_filter import no_fixtures
from pretouch.types import Inputs, Mode, QpOutcome, RangeReadings
from tests.following_arm import SHORT
from tests.fuzz import invariants, weather
from tests.fuzz.machine import Course, Machine
from tests.fuzz.worlds import World

MODES = ("HOLD", "TRACK", "REACT")
EVENTS = (
    "UNUSABLE", "TIME_BACKWARDS", "STATE_STALE", "BLOCKED", "CONTACT", "REACTING", "YIELDING", "OPENING", "CLAMPED",
    "SKIN_SILENT", "NO_FORCE", "OVERRUN", "WINDOW_FILLING", "CLEAR",
)  # fmt: skip
"""Those that no seed lacks."""
EXPECTED = [
    *(f"mode {mode}" for mode in MODES),
    *(f"outcome {outcome}" for outcome in ("SOLVED", "INFEASIBLE", "SKIPPED")),
    *(f"event {event}" for event in EVENTS),
    *(f"sight {sight}" for sight in weather.SIGHTS),
    *(f"force {force}" for force in weather.FORCES),
    *(f"fault {fault}" for fault in weather.FAULTS),
    *(f"fault lie about {part}" for part in ("q", "qd", "q_commanded", "qd_commanded")),
    *(f"restriction {mode}" for mode in ("none", "paper hard", "paper slack", "paper floor", "braking")),
    *(f"units {units}" for units in (0, 1, 7, 32)),
    *(f"{what} {yes}" for what in ("slack", "slowed", "on the axis", "latched") for yes in (True, False)),
    "period 0.01", "period 0.001", "arm panda", "arm fr3",
]  # fmt: skip


@pytest.mark.parametrize("seed", [1001, pytest.param(1002, marks=pytest.mark.slow)])
def test_some_thousand_steps(seed: int):
    reached = Machine(seed).run(2_400, each=120)
    assert all(reached[f"mode {mode}"] > 100 for mode in MODES)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_half_a_million_steps(seed: int):
    reached = Machine(seed).run(50_000)
    missing = [name for name in EXPECTED if not reached[name]]
    assert not missing
    assert reached["step"] == 50_000
    assert min(reached[f"mode {mode}"] for mode in MODES) > 2_000


@pytest.mark.slow
def test_no_compiled_loop_leaves_its_arrays(tmp_path: Path):
    # compiled code does not look where it reads and writes, unless it is compiled to
    run = "from tests.fuzz.machine import Machine; Machine(2001).run(6_000, each=120)"
    checked = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", run], cwd=root, env=checked, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


# the checks notice what they are there for


def honest(course: Course) -> Inputs:
    k = len(course.world.skin)
    return Inputs(
        course.time, course.robot(), RangeReadings(np.full(k, course.time), np.full(k, 0.25), np.zeros(k, int))
    )


@pytest.fixture(scope="module")
def arm(panda_model, paper_skin):
    """An arm on the move with an obstacle near its hand: its course, and a step with the state that it goes by."""
    ready = panda_model.description.q_ready
    world = World(panda_model, SHORT, paper_skin, no_fixtures(), Circle(), ready, np.zeros(7), False, 0.0)
    course = Course(Machine(0), world)
    course.weather.feel = "denormal"
    for _ in range(30):
        course.step(honest(course), deep=True)
    inputs = honest(course)
    step, _ = course.controller.step(course.state, inputs)
    assert step.qp.outcome is QpOutcome.SOLVED
    assert len(step.restricted) > 2
    return course, step, inputs.robot


def commanded(step, robot, command, model):
    invariants.check_command(replace(step, command=command), robot, SHORT, model)


def braked(step, robot, factor, model):
    held = replace(step, qp=replace(step.qp, outcome=QpOutcome.SKIPPED), command=factor * robot.qd_commanded)
    invariants.check_braking(held, robot, SHORT, model)


def told(course, step, *wrong):
    invariants.check_mode(step, course.state.mode, dict.fromkeys(wrong, ""), False, SHORT)


@pytest.mark.parametrize(
    "check",
    [
        lambda c, s, r: commanded(s, r, r.qd_commanded + 1.001 * c.other.description.qdd_max * 0.01, c.other),
        lambda c, s, r: commanded(
            s, replace(r, qd_commanded=c.other.description.qd_max - 1e-3), r.qd_commanded + 2e-3, c.other
        ),
        # at 0.5 rad/s a joint of 7.5 rad/s^2 needs 17 mrad to stand
        lambda c, s, r: commanded(
            s, replace(r, q_commanded=c.other.q_max - 0.01 - 0.015, qd_commanded=np.full(7, 0.5)), np.full(7, 0.5),
            c.other,
        ),
        lambda c, s, r: commanded(s, r, s.command * np.nan, c.other),
        *(lambda c, s, r, factor=factor: braked(s, r, factor, c.other) for factor in (1.01, -0.01, 0.999)),
        lambda c, s, r: invariants.check_rows(replace(s, command=s.command + 1e-3), SHORT, c.other),
        lambda c, s, r: invariants.check_rows(replace(s, approach_limit=s.approach_limit + 1e-6), SHORT, c.other),
        lambda c, s, r: invariants.check_rows(replace(s, restricted=s.restricted[1:]), SHORT, c.other),
        lambda c, s, r: invariants.check_speed_scale(replace(s, speed_scale=1.0), SHORT),
        lambda c, s, r: invariants.check_finite(replace(s, ee_velocity=s.ee_velocity * np.inf), r, SHORT),
        lambda c, s, r: invariants.check_shapes(replace(s, q=s.q[:6]), 7, 7),
        lambda c, s, r: invariants.check_shapes(replace(s, command=s.command.astype(np.float32)), 7, 7),
        lambda c, s, r: told(c, replace(s, mode=Mode.HOLD)),
        lambda c, s, r: told(c, replace(s, mode=Mode.REACT)),
        lambda c, s, r: told(c, replace(s, event=Event.OVERRUN)),
        lambda c, s, r: told(c, s, Event.STATE_STALE),
    ],
)  # fmt: skip
def test_what_breaks_an_invariant_is_noticed(arm, check):
    told(*arm[:2])
    with pytest.raises(AssertionError):
        check(*arm)


def test_a_difference_in_the_last_bit_is_noticed(arm):
    _, step, _ = arm
    assert invariants.same(step, replace(step, command=step.command.copy()))
    assert not invariants.same(step, replace(step, command=np.nextafter(step.command, 9.0)))
