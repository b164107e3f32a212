"""A live session in which a person changes profile, path and parameters as it runs, and silences units."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.limits import assert_within_limits
from tests.page.sessions import ARMED_S, AWAY, modes, poke, set_speed

from pretouch.errors import ParameterError
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
    with pytest.raises(ParameterError, match=r"Unknown unit nose: choose from "):
        running.silence(frozenset({"nose"}))
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


# Silent units


def test_a_dropped_unit_is_named_and_may_come_back_and_a_reset_does_not_bring_it(running):
    lost = running.skin.ids[3]
    assert np.all(running.frame.age < 0.1)
    running.silence(frozenset({lost}))
    after = running.advance(1.0)
    late = running.frame.late(running.world.profile.sight.silent_after_s)
    assert np.flatnonzero(late).tolist() == [3]
    assert running.frame.age[3] == pytest.approx(1.0, abs=0.1)
    assert modes(after) == [Mode.TRACK, Mode.HOLD]
    assert lost in after[-1].reason
    assert "check the unit's power" in after[-1].reason
    assert not np.any(after[-1].command)
    running.silence(frozenset())
    again = running.advance(1.0)
    assert modes(again) == [Mode.HOLD, Mode.TRACK]
    assert sum(s.mode is Mode.HOLD for s in again) < 10, "a unit that is heard again goes unnoticed"
    running.silence(frozenset({lost}))
    running.reset()
    after = running.advance(1.5)
    assert after[-1].mode is Mode.HOLD, "silence does not outlast a reset"
    assert lost in after[-1].reason


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
        lambda: session.silence(frozenset({rng.choice(ids)})),
        lambda: session.silence(frozenset()),
        lambda: session.move_hand(session.frame.step.ee_position + 0.1 * rng.standard_normal(3)),
        lambda: session.move_hand(AWAY),
        lambda: session.resume(),
    )
    steps = [session.frame.step]
    for _ in range(count):
        wishes[rng.integers(len(wishes))]()
        steps += session.advance(0.2)
    # whatever was wished for, the arm can still be touched
    session.silence(frozenset())
    session.set_profile(PROFILES["paper"])
    session.move_hand(AWAY)
    session.resume()
    steps += session.advance(3.0)
    steps += poke(session)
    assert_within_limits(SimpleNamespace(steps=steps), session.model)
    assert {s.mode for s in steps} == set(Mode)
    assert np.all(np.isfinite([s.q for s in steps]))
