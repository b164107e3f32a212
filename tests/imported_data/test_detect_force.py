"""Thresholds on a recorded force, held against the controller itself."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import RecordingError
from pretouch.imported_data.detect import detect
from pretouch.imported_data.log import Choice
from pretouch.imported_data.reading import open_log, read_force
from pretouch.profiles import PROFILES, at_rate, profile
from tests.following_arm import Arm
from tests.imported_data.files import PUSHES, force_columns, pushed, write_csv

PAPER = PROFILES["paper"]


def read(file):
    return read_force(open_log(file, Choice()), Choice())


@pytest.fixture
def of_force(tmp_path):
    """Read a force (N, 3) as from a CSV file."""
    return lambda force, rate=100.0: read(write_csv(tmp_path / f"{rate}.csv", force_columns(force, rate)))


def decided(recording, p):
    return detect(recording, p)[1]


@pytest.fixture
def controlled(panda_model, paper_skin):
    """Give forces to a controller, one a cycle; return its steps, and the cycles in which a contact is found."""

    def run(force, p):
        arm = Arm(panda_model, paper_skin, p)
        steps = [arm.step(tuple(sample)) for sample in force]
        return steps, [i for i, step in enumerate(steps) if step.contact is not None]

    return run


SOON = ((1.7, 0.6, (0.0, 40.0, 0.0)), (4.7, 0.5, (-45.0, 0.0, 10.0)), (7.7, 0.8, (0.0, 0.0, -35.0)))
LASTS = ((2.0, 4.0, (0.0, 60.0, 0.0)),)
"""A push that is found again after each reaction."""


@pytest.mark.parametrize(
    ("name", "pushes"),
    [
        ("paper", SOON), ("paper:detect.compare=raw", SOON), ("blind:window.samples=150", SOON),
        ("paper:react.decay_cycles=20", LASTS),
    ],
)  # fmt: skip
def test_a_controller_given_the_same_forces_decides_the_same(of_force, controlled, name, pushes):
    force, p = pushed(9.0, pushes), profile(name)
    found, (steps, cycles) = decided(of_force(force), p), controlled(force, p)
    assert len(cycles) >= 3
    assert [round((c.time_s - 0.005) * 100) for c in found.contacts] == cycles
    for contact, cycle in zip(found.contacts, cycles, strict=True):
        np.testing.assert_array_equal(contact.force_n, steps[cycle].contact.force)
        assert [axis in contact.axes for axis in "xyz"] == steps[cycle].contact.axes.tolist()
    np.testing.assert_array_equal(found.force, force)
    np.testing.assert_array_equal(found.upper, [s.thresholds.upper for s in steps])
    np.testing.assert_array_equal(found.lower, [s.thresholds.lower for s in steps])
    np.testing.assert_array_equal(found.reacting, [s.mode.value == "react" for s in steps])
    np.testing.assert_array_equal(found.armed, [s.armed for s in steps])


def test_jitter_of_a_few_milliseconds_neither_doubles_nor_drops_a_sample(tmp_path):
    force = pushed(10.0, PUSHES)
    columns = force_columns(force)
    columns["time_s"] = columns["time_s"] + np.random.default_rng(1).uniform(-2e-3, 2e-3, len(force))
    found = decided(read(write_csv(tmp_path / "j.csv", columns)), PAPER)
    np.testing.assert_array_equal(found.force[:990], force[:990])


def test_of_faster_data_the_newest_sample_of_each_cycle_is_taken(of_force):
    force = pushed(5.0, PUSHES, rate=1000.0)
    found = decided(of_force(force, 1000.0), PAPER)
    np.testing.assert_array_equal(found.force, force[::10])


def test_slower_data_are_held_and_the_way_out_is_named(of_force, controlled):
    force = pushed(9.0, SOON, rate=25.0)
    imported = of_force(force, 25.0)
    found = decided(imported, PAPER)
    np.testing.assert_array_equal(found.force[:100:4], force[:25])
    np.testing.assert_array_equal(found.force[3:100:4], force[:25])
    (note,) = detect(imported, PAPER)[0].notes
    assert (note.code, note.values["rate"], note.values["own"]) == ("slower", pytest.approx(25.0), 100.0)
    slow = at_rate(PAPER, 25.0)
    found = decided(imported, slow)
    assert [c.time_s for c in found.contacts] == pytest.approx([0.02 + i / 25 for i in controlled(force, slow)[1]])
    assert detect(imported, slow)[0].notes == ()


def test_after_a_gap_there_is_no_force_and_nothing_is_felt_until_it_comes_back(tmp_path):
    force = pushed(20.0, ((3.0, 0.6, (0.0, 40.0, 0.0)), (16.0, 0.6, (0.0, 40.0, 0.0))))
    columns = force_columns(force)
    kept = (columns["time_s"] < 8.0) | (columns["time_s"] >= 15.0)
    file = write_csv(tmp_path / "gap.csv", {name: values[kept] for name, values in columns.items()})
    imported = read(file)
    found = decided(imported, PAPER)
    assert [round(c.time_s, 1) for c in found.contacts] == [3.1, 16.1]
    assert np.isnan(found.force[(found.time > 8.2) & (found.time < 15.0)]).all()
    assert np.isfinite(found.force[(found.time > 7.99) & (found.time < 8.18)]).all()
    gap, deaf = detect(imported, PAPER)[0].notes
    assert (gap.code, gap.values["count"], gap.values["seconds"]) == ("gaps", 1, pytest.approx(7.01))
    values = {name: deaf.values[name] for name in ("seconds", "of", "longest", "time")}
    # the window fills for 1 s, and a force holds for 0.2 s
    assert values == pytest.approx({"seconds": 7.81, "of": 20.0, "longest": 6.81, "time": 8.19}, abs=0.03)


def test_a_gap_of_days_costs_no_time_and_no_memory(tmp_path):
    columns = force_columns(pushed(6.0, ()))
    columns["time_s"][300:] += 20 * 86_400.0
    found = decided(read(write_csv(tmp_path / "days.csv", columns)), PAPER)
    assert len(found.time) < 1000
    assert not found.contacts


@pytest.mark.parametrize("broken", [np.nan, 1e6])
def test_samples_that_are_no_estimate_leave_the_window_as_it_is(of_force, broken):
    force = pushed(6.0, ())
    force[300:320] = broken
    found = decided(of_force(force), PAPER)
    assert not found.contacts
    assert np.isnan(found.force[300:320]).all()
    np.testing.assert_array_equal(found.upper[300:320], np.tile(found.upper[299], (20, 1)))


def test_data_too_short_or_too_slow_are_one_sentence(of_force):
    with pytest.raises(RecordingError, match=r"has 0\.90 s, but not the 1 s of usable force that fill"):
        decided(of_force(pushed(0.9, ())), PAPER)
    with pytest.raises(RecordingError, match=r"comes every 1 s.*unit of the time"):
        decided(of_force(pushed(100.0, (), rate=1.0), 1.0), PAPER)


def test_base_forces_that_the_summary_names_are_the_borderline(of_force):
    imported = of_force(pushed(14.0, PUSHES))
    found = detect(imported, PAPER)[0].thresholds
    for f_base, contacts in ((found.f_base_all_n - 0.01, 1), (found.f_base_all_n + 0.01, 0)):
        p = replace(PAPER, detect=replace(PAPER.detect, f_base_n=f_base))
        assert len(decided(imported, p).contacts) == contacts
    assert found.f_base_all_n > 10.0


def test_the_noise_in_free_motion_is_that_of_the_data(of_force):
    result, _ = detect(of_force(pushed(60.0, PUSHES, noise=0.4)), PAPER)
    noise = result.thresholds
    np.testing.assert_allclose(noise.mean_n, [1.0, -2.0, 0.5], atol=0.2)
    np.testing.assert_allclose(noise.sigma_n, 0.4, rtol=0.1)
    # eq. 8 makes outliers smaller, and so the deviation in the window
    assert np.all((noise.width_n > 10.0) & (noise.width_n < 10.0 + noise.sigma_n))
    assert result.armed_s == pytest.approx(59.0, abs=0.05)
    assert len(result.contacts) == 3
    assert result.contacts_per_hour == pytest.approx(3 * 3600 / 59.0, rel=0.01)
