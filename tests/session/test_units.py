"""Units before a run, over real sockets."""

import itertools
import time

import pytest

from pretouch.arms.simulated.arm import SimulateOptions
from pretouch.arms.simulated.threaded import ThreadedArm
from pretouch.errors import HardwareError
from pretouch.loop import MonotonicClock
from pretouch.robot.model import RobotModel
from pretouch.session.units import UnitCheck
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.units.fleet import simulated_keys
from pretouch.units.health import HealthParams
from pretouch.units.network_skin import NetworkSkin


@pytest.fixture
def checked(panda_model, paper_skin):
    """A simulated arm with units, and the check of them."""
    keys = simulated_keys(paper_skin.ids, 0)
    model, scene = RobotModel(panda_model.description), SceneSpec()
    with NetworkSkin(paper_skin.ids, keys) as units:
        options = SimulateOptions(model, paper_skin, keys, *units.address, hand=False)
        with ThreadedArm(options, panda_model.description.q_ready, scene) as arm:
            yield arm, units, UnitCheck(units, panda_model, paper_skin, fixtures(scene), arm)


@pytest.mark.slow
def test_units_that_are_well_are_found_well_and_one_that_falls_silent_is_named(checked):
    arm, _, check = checked
    clock = MonotonicClock(0.01)
    check.wait(clock, 20.0, 1.0)
    assert not [finding.sentence for finding in check.findings() if finding.refused]

    arm._arm.fleet.units[2].silent = True
    end = time.monotonic() + 1.0
    while (now := clock.tick()) < end:
        check.take(now)
    refused = [finding for finding in check.findings() if finding.refused and finding.what != "machine"]
    assert [finding.sentence.startswith("hand_front has sent nothing for") for finding in refused] == [True]


def test_a_machine_too_slow_to_simulate_is_named_in_place_of_units(checked, panda_model, paper_skin, monkeypatch):
    arm, units, _ = checked
    limits = HealthParams(settle_s=0.2, rate_hz=1e3, rate_fault_hz=1e3)
    monkeypatch.setattr("pretouch.session.units.HealthParams", lambda: limits)
    left_out = itertools.count(0.0, 0.2)
    check = UnitCheck(units, panda_model, paper_skin, fixtures(SceneSpec()), arm, lambda: next(left_out))
    clock = MonotonicClock(0.01)
    check.wait(clock, 20.0, 0.6)
    end = time.monotonic() + 20.0
    while not (refused := [finding.what for finding in check.findings() if finding.refused]):
        assert time.monotonic() < end
        check.take(clock.tick())
    assert refused == ["machine"]


def test_units_that_are_not_heard_are_named(checked):
    arm, units, check = checked
    arm._arm.fleet.units[0].silent = True
    with pytest.raises(HardwareError, match=f"No data from hand_left at 127.0.0.1:{units.address[1]}"):
        check.wait(MonotonicClock(0.01), 1.5, 1.0)


def test_a_receiver_that_has_ended_is_said(checked):
    _, units, check = checked
    units.close()
    with pytest.raises(HardwareError, match="receiver of the units has ended"):
        check.wait(MonotonicClock(0.01), 1.5, 1.0)
