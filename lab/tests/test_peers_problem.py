"""The problem on which Pretouch is compared with its peers: the same for all, feasible, and thinly so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lab.peers import pretouch_peer as ours
from lab.peers import problem as posed
from lab.peers.__main__ import REFERENCE, figures, tables
from lab.peers.pretouch_peer import Rows, Step, panda_arm
from lab.peers.problem import Problem, approach_rows, damping, frames_of, generate, joint_box, linear_jacobian, load
from scipy.optimize import nnls

from pretouch.robot.model import RobotModel

SNAPSHOTS, POINTS = 12, 32


@pytest.fixture(scope="module")
def problem() -> Problem:
    return generate(*panda_arm(), SNAPSHOTS, POINTS, seed=3)


def constraints(problem: Problem, s: int):
    """Rows G qd <= h, joint box and all, of one snapshot."""
    G, h = approach_rows(problem.arm, *frames_of(problem.arm, problem.q[s]), problem.points[s])
    lower, upper = joint_box(problem.arm, problem.q[s], problem.qd[s])
    return G, h, lower, upper


def test_it_is_about_our_arm(problem: Problem, panda_model: RobotModel):
    for q in problem.q:
        kin = panda_model.kinematics(q)
        rotation, origin = frames_of(problem.arm, q)
        np.testing.assert_allclose(origin, kin.anchor, atol=1e-12)
        np.testing.assert_allclose(
            linear_jacobian(problem.arm, rotation, origin), panda_model.ee_jacobian(kin)[:3], atol=1e-12
        )
    assert len(problem.arm.radius) == len(panda_model.body.radius)


def test_the_motion_keeps_every_limit_by_a_margin_that_is_thin(problem: Problem):
    for s in range(SNAPSHOTS):
        G, h, lower, upper = constraints(problem, s)
        margin = h - G @ problem.witness[s]
        assert margin.min() >= posed.MARGIN - 1e-12
        assert margin.min() < 20 * posed.MARGIN
        # half of the points are those of smallest margin among four times as many
        assert np.median(margin) < 0.02
        assert np.all((lower < problem.witness[s]) & (problem.witness[s] < upper))


@pytest.fixture
def _in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the one function of the contender uncompiled, which takes seconds: its parts are those of the product."""
    monkeypatch.setattr(ours, "_solve", ours._solve.py_func)


@pytest.mark.slow
def test_our_compiled_answer_is_that_of_its_text(problem: Problem, monkeypatch: pytest.MonkeyPatch):
    rows = Rows(problem)
    compiled = [rows.solve(s) for s in range(SNAPSHOTS)]
    monkeypatch.setattr(ours, "_solve", ours._solve.py_func)
    np.testing.assert_allclose([rows.solve(s) for s in range(SNAPSHOTS)], compiled, rtol=0, atol=1e-9)


@pytest.mark.usefixtures("_in_python")
def test_our_answer_is_the_minimum(problem: Problem):
    rows, touched, arm = Rows(problem), 0, problem.arm
    for s in range(SNAPSHOTS):
        G, h, lower, upper = constraints(problem, s)
        qd = rows.solve(s)
        A, b = np.concatenate([G, np.eye(7), -np.eye(7)]), np.concatenate([h, upper, -lower])
        assert (A @ qd - b).max() < 1e-8
        # optimal, by Karush, Kuhn and Tucker: the cost falls only towards limits that are reached
        J = linear_jacobian(arm, *frames_of(arm, problem.q[s]))
        k = posed.MID_JOINT_GAIN
        mid = ((arm.q_min + arm.q_max) / 2 - problem.q[s]) / posed.MID_JOINT_TIME_S
        gradient = J.T @ (J @ qd - problem.velocity[s]) + damping(J) * qd + k * (qd - mid)
        reached = A @ qd - b > -1e-8
        assert nnls(A[reached].T, -gradient)[1] < 1e-8
        touched += bool(reached[: len(h)].any())
    assert touched > SNAPSHOTS / 2


@given(st.floats(0.0, 0.2), st.floats(1.0, 20.0))
def test_the_box_lets_the_arm_stop_before_its_limits_and_no_sooner(distance: float, acceleration: float):
    arm, period = panda_arm()[0], posed.PERIOD_S
    arm = replace(arm, qdd_max=np.full(7, acceleration), qd_max=np.full(7, 100.0))
    for sign, limit in ((1.0, arm.q_max), (-1.0, arm.q_min)):
        q = limit - sign * distance
        # the last velocity is such that it is position that limits
        fastest = sign * joint_box(arm, q, np.zeros(7))[sign > 0][0]
        if fastest >= acceleration * period * (1 - 1e-9):
            last = sign * np.sqrt(2 * acceleration * distance)
            fastest = sign * joint_box(arm, q, np.full(7, last))[sign > 0][0]
        assert travelled(fastest, acceleration, period) <= distance + 1e-12
        assert travelled(fastest + 1e-6, acceleration, period) > distance


def travelled(speed: float, acceleration: float, period: float) -> float:
    """Way of an arm that holds a speed for a period and then brakes, a velocity a period [rad]."""
    speeds = np.maximum(speed - acceleration * period * np.arange(2000), 0.0)
    return float(speeds.sum() * period)


@pytest.mark.usefixtures("_in_python")
@pytest.mark.parametrize("points", [0, 7])
def test_the_whole_step_tracks_with_as_many_units_that_see_something(points: int):
    problem = generate(*panda_arm(), SNAPSHOTS, points, seed=3)
    assert problem.points.shape == (SNAPSHOTS, points, 3)
    assert np.all(np.isfinite(Rows(problem).solve(0)))
    whole = Step(problem)
    steps = [whole.controller.step(*turn)[0] for turn in whole.turns]
    assert {len(step.obstacles.unit) for step in steps} == {points}
    # each is pure, and it tracks
    np.testing.assert_array_equal([whole.solve(s) for s in range(SNAPSHOTS)], [step.command for step in steps])


def test_a_file_holds_all_of_it(problem: Problem, tmp_path: Path):
    problem.save(tmp_path / "problem.npz")
    read = load(tmp_path / "problem.npz")
    for name in ("q", "qd", "witness", "velocity", "points"):
        np.testing.assert_array_equal(getattr(read, name), getattr(problem, name))
    for name, value in vars(problem.arm).items():
        np.testing.assert_array_equal(getattr(read.arm, name), value)


def test_tables_have_a_contender_a_line_and_a_number_of_points_a_column():
    blocks = {("a, rows", k): [[2000 * k, 4000 * k]] for k in (1, 2)} | {(REFERENCE, k): [[1000, 3000]] for k in (1, 2)}
    rows = [figures(name, k, 0.0, blocks) for name, k in blocks]
    times, ratios = tables(rows, "")
    assert times.rows == (("a, rows", "3 / -", "6 / -"), (REFERENCE, "2 / -", "2 / -"))
    assert ratios.rows == (("a, rows", "1.5", "3"), (REFERENCE, "1", "1"))
