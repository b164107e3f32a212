"""IMU samples in recordings: kept beside the inputs, recomputed bit for bit; recordings without them open as before."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch.recording.codec import decode_imu, encode_imu
from pretouch.recording.last_seconds import LastSeconds
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.recording.writer import Recording
from pretouch.types import ImuReadings, Inputs
from tests.fuzz.invariants import same
from tests.recording.runs import Run, controller_of

OURS = profile("pretouch:detect.cues=touch,imu")


def shaken(inputs: Inputs) -> Inputs:
    """The inputs with three samples of each of seven units, a jolt from 2 s on."""
    rng = np.random.default_rng(round(100 * inputs.stamp))
    stamp = inputs.stamp - np.tile([0.015, 0.0125, 0.01], 7)
    values = rng.normal(0.0, 0.1, (2, 21, 3)) + (5.0 if 2.0 <= inputs.stamp < 2.02 else 0.0)
    return replace(inputs, imu=ImuReadings(np.repeat(np.arange(7), 3), stamp, values[0], values[1]))


@pytest.fixture(scope="module")
def controller(panda_model, paper_skin):
    return controller_of(panda_model, paper_skin, OURS)


def test_a_run_with_imu_samples_is_recomputed_bit_for_bit(controller, tmp_path):
    run = Run(controller)
    with Recording(tmp_path / "a.mcap", controller) as recording:
        for _ in range(350):
            recording.record(run.turn(shaken))
    assert max(cycle.after.detector.cues[1].excess.max() for cycle in run.cycles) > 1.0
    recorded = open_recording(tmp_path / "a.mcap")
    verdict = verify(recorded)
    assert verdict.agrees
    assert verdict.exact
    assert verdict.checked == 350
    assert same(recorded[5].inputs, run.cycles[5].inputs)


def test_the_samples_come_back_to_the_bit():
    imu = ImuReadings(np.array([1, 0]), np.array([np.nan, -np.inf]), np.full((2, 3), np.inf), np.zeros((2, 3)))
    data = encode_imu(3, 1.0, imu)
    assert data is not None
    assert same(decode_imu(data), imu)


@pytest.mark.parametrize(
    "given",
    ["many", ImuReadings(np.zeros(2), np.zeros(2), np.zeros((2, 3)), np.zeros((2, 3))),
     ImuReadings(np.zeros(2, np.int64), np.zeros(2), np.zeros((3, 3)), np.zeros((2, 3)))],
)  # fmt: skip
def test_what_no_step_can_use_is_not_kept(given):
    assert encode_imu(0, 1.0, given) is None


def test_without_imu_samples_a_recording_has_none(controller, tmp_path):
    run = Run(controller)
    with Recording(tmp_path / "a.mcap", controller) as recording:
        for _ in range(20):
            recording.record(run.turn())
    assert b"ImuReadings" not in (tmp_path / "a.mcap").read_bytes()
    recorded = open_recording(tmp_path / "a.mcap")
    assert all(kept.inputs is not None and kept.inputs.imu is None for kept in recorded)
    assert verify(recorded).agrees


def test_the_seconds_before_a_hold_have_the_samples(controller, tmp_path):
    run, kept = Run(controller), LastSeconds(controller, tmp_path / "kept")
    for _ in range(30):
        kept.record(run.turn(shaken))
    lost = replace(shaken(run.inputs()), robot=None)
    kept.record(run.turn(lambda _: lost))
    kept.close()
    recorded = open_recording(kept.written[0])
    assert same(recorded[10].inputs.imu, run.cycles[10].inputs.imu)
