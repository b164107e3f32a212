"""What the loop asks a skin of its IMUs: only where the profile uses them, and only a skin that has any."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch import loop
from pretouch.hardware.traffic import ImuBatch, imu_readings
from pretouch.ports import imu_of
from pretouch.profiles import profile
from pretouch.types import ImuReadings, RangeReadings, RangeStatus
from pretouch_lab.baselines.accelerometers import ImpactState
from tests.fuzz.invariants import same
from tests.recording.runs import Run, controller_of

SAMPLES = imu_readings([ImuBatch(2, np.array([0.1, 0.2]), np.ones((2, 3)), np.zeros((2, 3)), 7)])


class Units:
    """A skin of seven units, with IMUs."""

    asked = 0

    def read(self) -> RangeReadings:
        return RangeReadings(np.zeros(7), np.zeros(7), np.full(7, int(RangeStatus.SIGNAL)))

    def imu(self) -> ImuReadings:
        self.asked += 1
        return SAMPLES


@pytest.mark.parametrize(("cues", "asked"), [("touch,imu", 1), ("touch", 0)])
def test_only_a_profile_that_uses_imus_asks(panda_model, paper_skin, cues, asked):
    controller, units = controller_of(panda_model, paper_skin, profile(f"pretouch:detect.cues={cues}")), Units()
    run = Run(controller)
    arm = SimpleNamespace(read=lambda: run.inputs().robot, command=lambda qd: None)
    cycle = loop.turn(controller, run.state, arm, units, 0.0)
    assert units.asked == asked
    assert (cycle.inputs.imu is SAMPLES) == bool(asked)
    assert len([said for said in cycle.after.detector.cues if isinstance(said, ImpactState)]) == asked


def test_a_skin_without_imus_gives_none():
    assert imu_of(SimpleNamespace(read=Units().read)) is None


def test_batches_of_units_become_samples_of_one_step():
    assert SAMPLES.unit.tolist() == [2, 2]
    assert SAMPLES.acceleration.shape == (2, 3)
    none = imu_readings([])
    assert (len(none.unit), none.acceleration.shape) == (0, (0, 3))


def test_without_samples_the_switch_changes_no_bit(panda_model, paper_skin):
    switched = ("pretouch:detect.cues=touch,imu", "pretouch:detect.cues=touch")
    runs = [Run(controller_of(panda_model, paper_skin, profile(name))) for name in switched]
    for _ in range(60):
        a, b = (run.turn() for run in runs)
        assert same(a.step, b.step)
        assert same(a.after.detector.test, b.after.detector.test)
