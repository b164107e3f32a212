import json
from itertools import pairwise

import numpy as np
import pytest
from lab.tests.width import width

from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.experiment import Sources
from pretouch_lab.paper.claims import detectable
from pretouch_lab.paper.claims.detectors import windowed
from pretouch_lab.paper.claims.forces import Event, apply

X, Y = np.eye(3)[:2]


def cell(motion, shape, size):
    return Cell(detectable.NAME, detectable.PROFILE, {"motion": motion, "shape": shape, "size": size})


@pytest.mark.parametrize(
    ("shape", "size", "since", "force", "reached"),
    [
        ("push", 10.0, 0.05, 10 / np.sqrt(2), 10 / np.sqrt(2)),
        ("push", 10.0, 0.1, 10.0, 10.0),
        ("push", 10.0, 0.15, 10 / np.sqrt(2), 10.0),
        ("push", 10.0, 0.2, 0.0, 10.0),
        ("step", 8.0, 0.005, 4.0, 4.0),
        ("step", 8.0, 0.5, 8.0, 8.0),
        ("step", 8.0, 0.995, 4.0, 8.0),
        ("step", 8.0, 1.05, 0.0, 8.0),
        ("ramp", 20.0, 0.5, 10.0, 10.0),
        ("ramp", 20.0, 1.5, 30.0, 30.0),
        ("ramp", 20.0, 1.505, 15.0, 30.0),
        ("ramp", 20.0, 1.52, 0.0, 30.0),
        ("step", 8.0, -0.1, 0.0, 0.0),
        ("push", 0.0, 0.1, 0.0, 0.0),
    ],
)
def test_forces_take_their_course(shape, size, since, force, reached):
    event = Event(shape, size, 3.0, X)
    assert event.force_n(3.0 + since) == pytest.approx(force, abs=1e-9)
    assert event.reached_n(3.0 + since) == pytest.approx(reached, abs=1e-9)


def test_events_end_when_their_force_is_gone():
    ends = {shape: Event(shape, 15.0, 3.0, X).end for shape in ("push", "step", "ramp")}
    assert ends == pytest.approx({"push": 3.2, "step": 4.0, "ramp": 5.01})


def test_a_force_acts_at_the_end_effectors_origin_and_nowhere_else(panda_model):
    plant = Plant(panda_model, SceneSpec(), PlantParams(), panda_model.description.q_ready, 100)
    body = panda_model.ee
    # a centre of mass a tenth of a metre beside the origin, as a tool may have it
    plant.mj_data.xipos[body] = plant.mj_data.xpos[body] + 0.1 * Y
    calls = []
    plant.before_each_step = calls.append
    apply(plant, (Event("step", 8.0, 1.0, X), Event("step", 8.0, 3.0, Y)))
    calls[0](1.5)
    # origin - centre = -0.1 y, and -0.1 y cross 8 x = 0.8 z
    assert plant.mj_data.xfrc_applied[body] == pytest.approx([8, 0, 0, 0, 0, 0.8])
    calls[0](3.5)
    assert plant.mj_data.xfrc_applied[body] == pytest.approx([0, 8, 0, 0, 0, 0])
    calls[0](5.0)
    assert not plant.mj_data.xfrc_applied.any()


@pytest.mark.parametrize("direction", [X, -Y, np.array([0.0, 0.6, -0.8])])
def test_the_robot_estimates_the_force_that_acts(panda_model, direction):
    plant = Plant(panda_model, SceneSpec(), PlantParams(), panda_model.description.q_ready, 101)
    apply(plant, (Event("step", 20.0, 0.3, direction),))

    def mean(duration):
        wrenches = []
        for _ in range(round(duration / 0.01)):
            plant.advance(0.01)
            wrenches.append(plant.read().wrench)
        return np.mean(wrenches, axis=0)

    plant.advance(0.1)
    before = mean(0.2)
    plant.advance(0.3)
    change = mean(0.6) - before
    assert np.linalg.norm(change[:3] - 20 * direction) < 1.5
    assert np.linalg.norm(change[3:]) < 0.5


@pytest.mark.parametrize("seed", [100, 101, 102])
def test_a_plan_pushes_along_all_axes_and_six_diagonals(seed):
    events = detectable.plan("step", 8.0, seed)
    directions = np.array([event.direction for event in events])
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
    axes = {tuple(d) for d in directions if np.count_nonzero(d) == 1}
    assert axes == {tuple(sign * d) for d in np.eye(3) for sign in (1.0, -1.0)}
    assert sum(np.count_nonzero(d) == 2 for d in directions) == 6
    assert len({tuple(d) for d in directions}) == 12
    gaps = [after.start - before.end for before, after in pairwise(events)]
    assert min(gaps) >= 1.4
    assert max(gaps) <= 1.9
    assert events[0].start >= 2.9


def test_the_seed_decides_order_and_place_and_the_size_does_not():
    weak, strong, other = (detectable.plan("push", *which) for which in ((4.0, 100), (30.0, 100), (4.0, 101)))
    assert [e.start for e in weak] == [e.start for e in strong]
    assert all(np.array_equal(a.direction, b.direction) for a, b in zip(weak, strong, strict=True))
    assert not all(np.array_equal(a.direction, b.direction) for a, b in zip(weak, other, strict=True))
    places = [detectable.path("moving", seed).point(0.0) for seed in (100, 101)]
    assert np.linalg.norm(places[0] - places[1]) > 0.01
    assert detectable.path("rest", 100).point(0.0) == pytest.approx(places[0])
    assert not detectable.path("rest", 100).tangent(0.001).any()


TIMES = np.round(np.arange(1.0, 10.0, 0.01), 2)


def firing(*spans):
    return np.isin(TIMES, [t for start, end in spans for t in TIMES if start <= t < end])


@pytest.mark.parametrize(
    ("shape", "size", "spans", "expected"),
    [
        ("push", 8.0, [(5.07, 5.2)], 5.07),
        ("push", 8.0, [(5.295, 5.5)], 5.3),
        ("push", 8.0, [(5.305, 5.5)], None),
        ("push", 8.0, [(4.5, 4.9), (5.1, 5.2)], 5.1),
        ("push", 8.0, [(4.5, 5.05), (5.1, 5.2)], None),
        ("step", 8.0, [(6.05, 6.2)], 6.05),
        ("step", 8.0, [(6.15, 6.2)], None),
        ("ramp", 20.0, [(6.495, 6.6)], 6.5),
        ("ramp", 20.0, [(6.505, 6.6)], None),
    ],
)
def test_an_event_is_felt_while_it_lasts_by_a_detector_that_was_silent(shape, size, spans, expected):
    assert detectable.answered(firing(*spans), TIMES, Event(shape, size, 5.0, X)) == expected


def still(rise):
    """Make a course without noise: nothing, and a force (S, 3) [N] along x from 5 s on."""
    force = np.zeros((len(TIMES), 3))
    force[TIMES > 5.0, 0] = rise(TIMES[TIMES > 5.0] - 5.0)
    course = windowed(force)
    return course, TIMES[-len(course.force) :]


def answer(found, detector, near):
    return next(a for a in found if (a["detector"], a["object"], a["direction"]) == (detector, near, "axis"))


def test_a_step_without_noise_is_felt_from_the_threshold_on():
    course, times = still(lambda since: np.where(since < 1.0, 8.0, 0.0))
    found = detectable.answers(course, times, (Event("step", 8.0, 5.0, X),))
    # the first sample is 8 N over a mean of 0.08 N at most, with a deviation of 0.08 N: over 6 N, below 10 N
    near, far = (answer(found, "raw", where) for where in ("near", "far"))
    assert (near["detected"], near["events"], near["delay_s"], near["reached_n"]) == (1, 1, 0.01, 8.0)
    assert (far["detected"], far["delay_s"], far["reached_n"]) == (0, None, None)
    assert answer(found, "raw twice", "near")["delay_s"] == 0.02
    # by eq. 8 it is 8 (1 - 0.9^n): after 20 samples 7.0 N, 6.1 N over the mean, with a deviation of 2.1 N: below 8.1 N
    assert answer(found, "filtered", "near")["detected"] == 0
    assert {a["events"] for a in found if a["direction"] == "diagonal"} == {0}
    assert answer(found, "fixed 12 N", "any")["detected"] == 0


def test_a_step_of_thirteen_newtons_is_felt_late_by_the_filtered_value():
    course, times = still(lambda since: np.where(since < 1.0, 13.0, 0.0))
    found = detectable.answers(course, times, (Event("step", 13.0, 5.0, X),))
    # after 20 samples 11.4 N, 9.8 N over the mean, with a deviation over 3 N: above 6 + 3 N, below 10 + 3 N
    assert 0.1 <= answer(found, "filtered", "near")["delay_s"] <= 0.2
    assert answer(found, "filtered", "far")["detected"] == 0


def test_the_mean_follows_a_slow_ramp_so_that_it_is_never_felt():
    course, times = still(lambda since: np.where(since <= 3.0, 10.0 * since, 0.0))
    found = detectable.answers(course, times, (Event("ramp", 10.0, 5.0, X),))
    # raw stays 5 N over the mean of the last second, below 6 N; a fixed threshold is passed at its force
    for detector in ("raw", "raw twice", "filtered"):
        assert answer(found, detector, "near")["detected"] == 0
    assert answer(found, "fixed 20 N", "any")["reached_n"] == pytest.approx(20.1)
    assert answer(found, "fixed 20 N", "any")["delay_s"] == pytest.approx(2.01)


def entry(size, detected, events=10):
    return {"size": size, "detected": detected, "events": events}


@pytest.mark.parametrize(
    ("detected", "expected"),
    [([0, 9, 10], 6.0), ([9, 8, 10], 8.0), ([10, 10, 10], 4.0), ([10, 10, 8], None), ([0, 0, 0], None)],
)
def test_a_size_is_felt_if_all_larger_ones_are_too(detected, expected):
    sizes = [entry(s, d) for s, d in zip((4.0, 6.0, 8.0), detected, strict=True)]
    assert detectable.smallest_detected(sizes) == expected


@pytest.fixture(scope="module")
def rows(context):
    return [detectable.trial(cell("rest", "push", size), 100, context)[0] for size in (0.0, 30.0)]


@pytest.mark.slow
def test_a_row_says_where_it_is_from_and_all_that_was_found(rows):
    row = rows[1]
    assert list(row) == ["experiment", "motion", "shape", "size", "profile", "seed", "answers", "held"]
    assert (row["motion"], row["shape"], row["size"], row["seed"], row["held"]) == ("rest", "push", 30.0, 100, False)
    assert len(row["answers"]) == 2 * len(detectable.JUDGES) == 20
    assert {a["events"] for a in row["answers"]} == {6}
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_an_arm_at_rest_feels_hard_pushes_and_not_none(rows):
    for where in ("near", "far"):
        hard, none = (answer(row["answers"], "raw", where) for row in (rows[1], rows[0]))
        assert hard["detected"] == 6
        assert 0.02 < hard["delay_s"] < 0.15
        assert 5.0 < hard["reached_n"] <= 30.0
        assert none["detected"] < 3
    near, far = (answer(rows[1]["answers"], "raw", where) for where in ("near", "far"))
    assert near["delay_s"] < far["delay_s"]


def test_summary_tables_and_figure_of_an_unfinished_run(rows):
    summary = detectable.EXPERIMENT.summarise([*rows, rows[1] | {"shape": "ramp", "size": 60.0}])
    assert summary["trials"] == 3
    found = {(c["shape"], c["detector"], c["object"], c["direction"]): c for c in summary["cells"]}
    raw = found["push", "raw", "near", "axis"]
    assert [e["size"] for e in raw["sizes"]] == [0.0, 30.0]
    assert raw["smallest_detected"] == 30.0
    assert raw["sizes"][1]["fraction"] == 1.0
    assert raw["sizes"][1]["delay_s"]["n"] == 1
    forces, ramps = detectable.EXPERIMENT.tables(summary)
    texts = {row[:2]: row[2:] for row in forces.rows}
    assert texts["raw", "near"] == ("30 / 30", "", "", "", "", "", "")
    assert ("fixed 25 N", "any") in {row[:2] for row in ramps.rows}
    (picture,) = detectable.EXPERIMENT.draw(Sources(summary, lambda _: None, ()))
    assert [len(axes.lines) for axes in picture.figure.axes] == [5, 0, 0, 0]
    nothing = detectable.EXPERIMENT.summarise([])
    assert detectable.EXPERIMENT.tables(nothing) == []
    assert detectable.EXPERIMENT.draw(Sources(nothing, lambda _: None, ())) == []


def test_whole_tables_fit_a_terminal(rows):
    everywhere = [
        rows[1] | {"motion": motion, "shape": shape, "size": 30.0}
        for motion in detectable.SPEEDS_M_S
        for shape in detectable.SIZES
    ]
    nothing = {"motion": "moving", "shape": "step"}
    tables = detectable.EXPERIMENT.tables(detectable.EXPERIMENT.summarise([*everywhere, rows[0] | nothing]))
    assert len(tables) == 2
    for table in tables:
        assert all(all(row) for row in table.rows)
        assert width(table) <= 80


def test_cells_are_all_different_and_cheap_enough(context):
    cells = detectable.EXPERIMENT.cells(Grid(("blind", "paper")))
    assert len({c.name for c in cells}) == len(cells) == 87
    assert 4 * sum(map(detectable.EXPERIMENT.cost, cells)) < 12_000
    assert all(context.profile(c).detect.f_base_n == 1000.0 for c in cells)


@pytest.mark.slow
def test_a_near_object_lets_pushes_be_felt_that_are_not_felt_far_from_it(context):
    found = [detectable.trial(cell("slow", "push", 20.0), seed, context)[0]["answers"] for seed in range(200, 204)]
    near, far = (sum(answer(a, "filtered", where)["detected"] for a in found) for where in ("near", "far"))
    assert near > 2 * far
    assert near >= 18
