"""A live session in which a person changes profile, path, parameters, stiffness and sensor faults as it runs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.limits import assert_within_limits
from tests.page.sessions import ARMED_S, AWAY, modes, poke, set_speed

from pretouch.errors import ParameterError
from pretouch.page.room import Faults
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES, profile
from pretouch.types import Mode


def beside(session: LiveSimulation, gap: float) -> None:
    """Hold the hand in front of the robot's, some way off [m]."""
    x, y, z = session.frame.step.ee_position
    session.move_hand(np.array([x + gap, y, z + 0.1]))


@pytest.fixture
def running(live):
    """A session on its way."""
    session = live()
    session.advance(ARMED_S)
    assert session.frame.step.mode is Mode.TRACK
    return session


def test_a_profile_is_switched_while_it_runs(running):
    beside(running, 0.3)
    seen = running.advance(1.5)
    assert any(len(s.obstacles.point) for s in seen)
    assert min(s.speed_scale for s in seen) < 0.9
    world, before = running.world, running.frame.step.command
    running.set_profile(PROFILES["blind"])
    after = running.advance(3.0)
    assert running.world.profile.name == running.settings.profile.name == "blind"
    assert world.profile.name == "paper", "a world changes under the hands of who looks at it"
    assert not any(len(s.obstacles.point) for s in after)
    assert after[-1].speed_scale == 1.0
    assert np.all(np.abs(after[0].command - before) <= running.model.description.qdd_max * 0.01 + 1e-12)


def test_another_speed_is_reached_gently(running):
    running.advance(1.0)
    assert np.linalg.norm(running.frame.step.ee_velocity) == pytest.approx(0.3, abs=0.03)
    set_speed(running, 0.1)
    after = running.advance(1.5)
    assert np.linalg.norm(after[-1].ee_velocity) == pytest.approx(0.1, abs=0.02)
    assert modes(after) == [Mode.TRACK]
    assert running.world.profile.task.speed_m_s == 0.1


def test_what_cannot_be_is_refused_and_nothing_changes(running):
    settings, world = running.settings, running.world
    with pytest.raises(
        ParameterError, match=r"The control period is 0.002 s, but can change only by a reset: it stays 0.01 s"
    ):
        running.set_profile(profile("paper:task.control_period_s=0.002"))
    with pytest.raises(ParameterError, match=r"speed_m_s is -1"):
        set_speed(running, -1)
    with pytest.raises(ParameterError, match=r"LiveSettings.path is 'square': choose one of circle, line"):
        running.set_path("square")
    with pytest.raises(ParameterError, match=r"LiveSettings.stiffness is 10: it must be at least 3000"):
        running.set_stiffness(10)
    with pytest.raises(ParameterError, match=r"Unknown unit nose: choose from "):
        running.set_faults(Faults(frozenset({"nose"})))
    with pytest.raises(ParameterError, match=r"Faults.noise_factor is 21: it must be at most 20"):
        running.set_faults(Faults(noise_factor=21))
    assert running.settings == settings
    assert running.world is world
    assert modes(running.advance(0.1)) == [Mode.TRACK]


def test_another_path_is_joined_without_a_contact_and_the_same_path_again_is_no_change(running):
    running.set_path("line")
    after = running.advance(6.0)
    assert running.world.path.length == pytest.approx(2.0)
    assert modes(after) == [Mode.TRACK], "the change of path is felt as a contact"
    assert np.linalg.norm(after[-1].ee_position - after[-1].path_position) < 0.02
    running.set_path("circle")
    world = running.world
    running.set_path("circle")
    assert running.world is world
    assert modes(running.advance(6.0)) == [Mode.TRACK]
    off_centre = (running.frame.step.ee_position - [0.5, 0.0, 0.25])[1:]
    assert np.linalg.norm(off_centre) == pytest.approx(0.25, abs=0.02)


# Sensor faults


def test_a_dropped_unit_is_named_and_may_come_back_and_a_reset_does_not_bring_it(running):
    lost = running.skin.ids[3]
    assert np.all(running.frame.age < 0.1)
    running.set_faults(Faults(frozenset({lost})))
    after = running.advance(1.0)
    late = running.frame.late(running.world.profile.sight.silent_after_s)
    assert np.flatnonzero(late).tolist() == [3]
    assert running.frame.age[3] == pytest.approx(1.0, abs=0.1)
    assert modes(after) == [Mode.TRACK, Mode.HOLD]
    assert lost in after[-1].reason
    assert "check the unit's power" in after[-1].reason
    assert not np.any(after[-1].command)
    running.set_faults(Faults())
    again = running.advance(1.0)
    assert modes(again) == [Mode.HOLD, Mode.TRACK]
    assert sum(s.mode is Mode.HOLD for s in again) < 10, "a unit that is heard again goes unnoticed"
    running.set_faults(Faults(frozenset({lost})))
    running.reset()
    after = running.advance(1.5)
    assert after[-1].mode is Mode.HOLD, "faults do not outlast a reset"
    assert lost in after[-1].reason


def test_noise_and_latency_are_those_asked_for(running):
    set_speed(running, 0.001)
    beside(running, 0.2)
    running.advance(2.0)

    def spread() -> float:
        seen = np.array([s.range_distance for s in running.advance(2.0)])
        return float(np.nanstd(seen[:, np.isfinite(seen).mean(axis=0) > 0.5], axis=0).mean())

    quiet = spread()
    running.set_faults(Faults(noise_factor=2.0))
    assert spread() == pytest.approx(2.0 * quiet, rel=0.35)
    running.set_faults(Faults(latency_s=0.35))
    late = running.advance(1.0)
    assert late[-1].mode is Mode.HOLD
    assert all(unit in late[-1].reason for unit in running.skin.ids)
    running.set_faults(Faults())
    assert running.advance(1.0)[-1].mode is Mode.TRACK


def test_a_latched_hold_ends_when_a_person_resumes(running):
    plant, read = running.room.plant, running.room.plant.read
    plant.read = lambda: replace(read(), q=np.full(7, np.nan))
    running.advance(0.1)
    plant.read = read
    latched = running.advance(0.5)
    assert {s.mode for s in latched} == {Mode.HOLD}
    assert "then resume" in latched[-1].reason
    running.resume()
    assert running.advance(0.5)[-1].mode is Mode.TRACK


# Stiffness


def pressed(session: LiveSimulation) -> float:
    """Stiffness [N/m] of the one contact there is: force over depth, at rest."""
    plant = session.room.plant
    stiffness = []
    for _ in range(30):
        session.single_step()
        (contact,) = plant.mj_data.contact[: plant.mj_data.ncon]
        stiffness.append(np.linalg.norm(plant.true_force) / -contact.dist)
    return float(np.mean(stiffness))


def test_a_stiffness_is_felt_from_the_next_touch_on(live):
    session = live(profile=profile("blind:detect.f_base_n=500:task.speed_m_s=0.001"), stiffness=40_000.0)
    session.advance(ARMED_S)
    below = session.frame.step.ee_position - [0.0, 0.0, 0.03]
    away = below - [0.0, 0.0, 0.1]
    session.move_hand(np.array([away[0] + 0.3, *away[1:]]))
    session.advance(2.0)
    session.move_hand(away)
    session.advance(2.0)
    session.move_hand(below)
    session.advance(2.0)
    assert pressed(session) == pytest.approx(40_000.0, rel=0.03)
    session.set_stiffness(15_000.0)
    assert pressed(session) == pytest.approx(40_000.0, rel=0.03), "a compressed spring became another"
    assert session.room.stiffness == 40_000.0
    session.move_hand(away)
    session.advance(1.0)
    assert session.room.stiffness == 15_000.0
    session.move_hand(below)
    session.advance(2.0)
    assert pressed(session) == pytest.approx(15_000.0, rel=0.03)


# Everything at once


@pytest.mark.parametrize(
    ("seed", "count"), [(0, 60), *(pytest.param(seed, 120, marks=pytest.mark.slow) for seed in range(3))]
)
def test_no_command_leaves_the_limits_whatever_a_person_does(live, seed, count):
    rng, session = np.random.default_rng(seed), live(seed=seed, object=("none", "board -y", "board +y")[seed])
    names, ids = sorted(PROFILES), session.skin.ids
    wishes = (
        lambda: session.set_profile(PROFILES[names[rng.integers(len(names))]]),
        lambda: session.set_profile(profile(f"paper:window.samples={rng.integers(20, 120)}")),
        lambda: session.set_profile(
            profile(f"paper:approach{rng.choice(['=none', '.rows=hard', '.rows=slack', '.rows=floor'])}")
        ),
        lambda: session.set_profile(profile("paper:react.decay_cycles=50:task.position_margin_rad=0.05")),
        lambda: set_speed(session, rng.uniform(0.05, 1.0)),
        lambda: session.set_path(str(rng.choice(["circle", "line"]))),
        lambda: session.set_faults(Faults(frozenset({rng.choice(ids)}), rng.uniform(0, 10), rng.uniform(0, 0.1))),
        lambda: session.set_faults(Faults()),
        lambda: session.set_stiffness(rng.uniform(3_000.0, 150_000.0)),
        lambda: session.move_hand(session.frame.step.ee_position + 0.1 * rng.standard_normal(3)),
        lambda: session.move_hand(AWAY),
        lambda: session.resume(),
    )
    steps = [session.frame.step]
    for _ in range(count):
        wishes[rng.integers(len(wishes))]()
        steps += session.advance(0.2)
    # whatever was wished for, the arm can still be touched
    session.set_faults(Faults())
    session.set_profile(PROFILES["paper"])
    session.move_hand(AWAY)
    session.resume()
    steps += session.advance(3.0)
    steps += poke(session)
    assert_within_limits(SimpleNamespace(steps=steps), session.model)
    assert {s.mode for s in steps} == set(Mode)
    assert np.all(np.isfinite([s.q for s in steps]))
