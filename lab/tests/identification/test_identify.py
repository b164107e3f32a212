import tomllib
from dataclasses import replace

import numpy as np
import pytest
from lab.tests.identification.made import (
    FRICTION,
    MODEL,
    PLANT,
    USUAL,
    Made,
    free_motion,
    row,
    sigmas_off,
    usual_motion,
)

from pretouch.errors import CalibrationError
from pretouch_lab.domain_randomisation import drawn, world_set
from pretouch_lab.identification.arm_file import arm_toml
from pretouch_lab.identification.fit import friction_parts
from pretouch_lab.identification.identify import identify

MADE = Made()


@pytest.fixture(scope="module")
def samples():
    return usual_motion().at(np.arange(9, 60_000, 10))


@pytest.fixture(scope="module")
def found(samples):
    return identify(samples, MODEL, USUAL)


def test_everything_comes_out_within_its_errors_and_nothing_is_left_out(found):
    assert sigmas_off(found, 0, MADE.offset) < 4.0
    assert found.fit.of_joints(found.fit.errors)[:, 0].max() < 0.2
    assert sigmas_off(found, 1, FRICTION) < 4.0
    ripple, phase = row(found, "ripple_nm"), row(found, "ripple_phases_rad")
    assert np.all(np.abs(ripple.values - MADE.ripple) <= 4.0 * ripple.standard_errors)
    assert np.abs(np.angle(np.exp(1j * (phase.values - 0.7)))).max() < 0.3
    payload, error = found.fit.payload
    assert abs(payload - MADE.payload) < 4 * error < 0.2
    assert found.fit.gain == pytest.approx(MADE.gain, rel=0.02)
    noise, true = found.noise, MADE.torque_noise
    assert noise.velocity_rad_s == pytest.approx(MADE.velocity_noise, rel=0.03)
    assert np.all(np.abs(noise.torque_nm - true) <= 4.0 * noise.torque_errors_nm + 0.05 * true)
    assert found.spans == ()
    assert found.seconds > 59.0


def test_the_file_sets_a_simulation_to_that_arm(found, tmp_path):
    place = tmp_path / "arm.toml"
    place.write_text(arm_toml(found, MODEL, 'a "recording"'))
    plant = drawn(world_set(str(place)), 3).plant
    plant.check_joints(MODEL.n, len(MODEL.links))
    own = found.fit.of_joints(found.fit.numbers)
    assert plant.offsets_nm == pytest.approx(own[:, 0], rel=1e-4)
    assert plant.payload_kg == pytest.approx(found.fit.numbers[-2], rel=1e-4)
    assert plant.friction_compensated == PLANT.friction_compensated
    assert "friction_compensated stays at 0.2" in place.read_text()
    assert len(tomllib.loads(place.read_text())["plant"]["mass_factors"]["value"]) == len(MODEL.links)


@pytest.mark.slow
def test_a_contact_is_found_and_left_out():
    found = identify(free_motion(replace(MADE, push=(30.0, 31.0))), MODEL, USUAL)
    assert len(found.spans) == 1
    begin, end = found.spans[0]
    assert begin < 30.0 < 31.0 < end < 33.0
    assert "1 spans look like contacts" in " ".join(found.notes)
    assert sigmas_off(found, 0, MADE.offset) < 4.0


def test_samples_that_are_no_numbers_and_gaps_are_left_out_and_said(samples):
    tau = samples.tau.copy()
    tau[1000, 3] = np.nan
    found = identify(replace(samples, tau=tau).at(np.r_[:3000, 3200:6000]), MODEL, USUAL)
    said = " ".join(found.notes)
    assert "1 of 5800 samples are not finite numbers" in said
    assert "gaps" in said
    assert found.fit.numbers[-2] == pytest.approx(MADE.payload, abs=0.1)


def pushed(samples):
    """Return samples of an arm that somebody pushes for seconds, again and again."""
    return replace(samples, tau=samples.tau + 15.0 * (np.sin(np.arange(len(samples.stamp)) / 300.0) > 0.3)[:, None])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: s.at(np.arange(1000)), "record 20 s or more of free motion"),
        (lambda s: replace(s, q=s.q[:1] + 0.0 * s.q), "The arm stands"),
        (lambda s: replace(s, tau=s.tau * np.nan), "no two samples with numbers"),
        (lambda s: replace(s, stamp=10.0 * s.stamp), "The samples come at 10 Hz"),
        (lambda s: replace(s, q=s.q[:, :6]), "has 6 joints and 7 torques"),
        pytest.param(pushed, "looks like contacts", marks=pytest.mark.slow),
    ],
)
def test_a_recording_that_cannot_tell_is_refused_with_what_is_missing(samples, change, said):
    with pytest.raises(CalibrationError, match=said):
        identify(change(samples), MODEL, USUAL)


@pytest.mark.slow
def test_torques_with_gravity_in_them_are_of_another_arm(samples):
    some = samples.at(np.arange(2500))
    gravity = np.array([MODEL.mass_matrix_and_bias(q, np.zeros(7), np.zeros(7))[1] for q in some.q])
    with pytest.raises(CalibrationError, match="another arm than panda"):
        identify(replace(some, tau=some.tau + gravity), MODEL, USUAL)


def test_the_derivatives_of_friction_are_those_of_differences():
    speed, steep, off, h = np.linspace(-1, 1, 21)[:, None], np.array([8.0]), np.array([0.03]), 1e-6
    value, by_log, by_off = friction_parts(speed, steep, off)
    assert value[10] == pytest.approx(0.0)
    assert by_log == pytest.approx((friction_parts(speed, steep * np.exp(h), off)[0] - value) / h, abs=1e-5)
    assert by_off == pytest.approx((friction_parts(speed, steep, off + h)[0] - value) / h, abs=1e-4)
