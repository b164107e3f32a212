"""Units watched, over real sockets."""

import itertools
import re
import time

import pytest

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.errors import HardwareError
from pretouch.loop import MonotonicClock
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.session.may_move import StandingArm, refusals
from pretouch.units.fleet import simulated_keys
from pretouch.units.health import HealthParams
from pretouch.units.skin import NetworkSkin
from pretouch.units.watch import UnitWatch
from tests.session.arms import FollowingArm
from tests.units.desk import Desk


@pytest.fixture
def units(paper_skin):
    """Units on a desk, and what hears them."""
    keys = simulated_keys(paper_skin.ids, 0)
    with NetworkSkin(paper_skin.ids, keys) as skin, Desk(keys, skin.address[1]) as desk:
        yield desk.fleet.units, skin


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "said"),
    [("", "^$"), ("silent", "^hand_front has sent nothing for"), ("stuck", "^hand_front repeats 0.* its range finder")],
)
def test_a_unit_that_fails_after_it_was_heard_refuses_a_run_and_one_that_is_well_does_not(
    units, panda_model, paper_skin, monkeypatch, fault, said
):
    wait = UnitWatch.wait

    def spoil(watch, clock):
        wait(watch, clock, 20.0, 1.0)
        units[0][2].silent, units[0][2].stuck = fault == "silent", fault == "stuck"

    monkeypatch.setattr(UnitWatch, "wait", spoil)
    controller = Controller(panda_model, paper_skin, no_fixtures(), Circle(), PROFILES["blind"])
    arm = FollowingArm(panda_model.description.q_ready)
    standing = StandingArm(arm, units[1], controller, -0.2, MonotonicClock(0.01), approach=True)
    refused = refusals(finding for finding in standing.check()[1] if finding.what != "machine")
    assert re.search(said, " ".join(refused))
    assert len(refused) == bool(fault)


def test_a_machine_too_slow_to_simulate_is_named_in_place_of_units(units, monkeypatch):
    limits = HealthParams(settle_s=0.2, rate_hz=1e3, rate_fault_hz=1e3)
    monkeypatch.setattr("pretouch.units.watch.HealthParams", lambda: limits)
    left_out = itertools.count(0.0, 0.2)
    watch, clock = UnitWatch(units[1], 0.1, left_out=lambda: next(left_out)), MonotonicClock(0.01)
    watch.wait(clock, 20.0, 0.6)
    end = time.monotonic() + 20.0
    while not (faults := [finding.what for finding in watch.judge()[1] if finding.level == "fault"]):
        assert time.monotonic() < end
        clock.tick()
        watch.take()
    assert faults == ["machine"]


def test_units_that_are_not_heard_are_named(units):
    units[0][0].silent = True
    with pytest.raises(HardwareError, match=f"No data from hand_left at 127.0.0.1:{units[1].address[1]}"):
        UnitWatch(units[1], 0.1).wait(MonotonicClock(0.01), 1.5, 1.0)


def test_a_receiver_that_has_ended_is_said(units):
    units[1].close()
    with pytest.raises(HardwareError, match="receiver of the units has ended"):
        UnitWatch(units[1], 0.1).wait(MonotonicClock(0.01), 1.5, 1.0)


def test_updates_come_in_time(units):
    updates = list(UnitWatch(units[1], 0.2).updates(0.9))
    assert 0.9 <= updates[-1].elapsed < 1.4
    heard = [one for update in updates for one in update.samples]
    assert len({(one.unit, one.sample.sequence) for one in heard}) == len(heard) > 7 * 20
