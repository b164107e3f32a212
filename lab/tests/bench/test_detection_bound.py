"""How much the torques of touched hard arms tell: three tests, each at a level that the arm's free motion never passed.

Two of them know what no detector knows beforehand. `python -m lab.tests.bench.test_detection_bound` plays all arms, and
prints what docs/explanation/detection.md says.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from pretouch.types import some_of
from pretouch_lab.bench.contenders import DETECTORS
from pretouch_lab.bench.detection import about, plays, quiet_noise, streamed, torques_of
from pretouch_lab.bench.replays import Steps
from pretouch_lab.bench.scenes import ArmCell, model, scenario
from pretouch_lab.replay import DetectorAlone

ARMS = [play for play in plays("development", quick=False) if play[0]["family"] == "hard" and play[0]["count"]]
LENGTHS = (2, 4, 8, 16)  # samples of the means that the first two tests compare
LEARNING_S, BEFORE_S, AFTER_S = 30.0, 0.05, 0.35  # the beginning, and the times about a contact, are no free motion


def delays(cell, seed):
    """The delays [s] of the tests `place`, `covariance` and `pretouch` for clear contacts (C, 3), NaN if missed."""
    stream, touches = streamed(ArmCell(**cell), seed)
    stamp, rules, noise = stream.stamp, scenario("contacts")["judged"], quiet_noise(touches, stream)
    residual, evidence = replayed(Steps(stream, model()))
    free = stamp > LEARNING_S
    for touch in touches:
        free &= (stamp < touch.start - BEFORE_S) | (stamp > touch.end + AFTER_S)
    means = [lfilter(np.full(length, 1.0 / length), 1.0, residual, axis=0) for length in LENGTHS]
    weighted = [mean @ np.linalg.inv(np.cov(mean[free].T)) for mean in means]
    whole = [(one * mean).sum(axis=1) for one, mean in zip(weighted, means, strict=True)]
    rows = []
    for touch in (each for each in touches if about(each, stream, noise)["detectable"]):
        onset = touch.onset(rules["onset_n"])
        during = slice(*np.searchsorted(stamp, [onset, touch.end + rules["late_s"]], side="right"))
        torques = torques_of(touch, stream, during.start)
        tests = [one @ torques for one in weighted], whole, [evidence]
        over = [np.any([each[during] > each[free].max() for each in test], axis=0) for test in tests]
        rows.append([stamp[during][each.argmax()] - onset if each.any() else np.nan for each in over])
    return np.array(rows)


def replayed(steps):
    """The residual (S, n) and the evidence (S,) of `pretouch`."""
    profile, end, rows = DETECTORS[-1].profile, 0, []
    detector, (every, count) = DetectorAlone(profile, steps.model), steps.stream.near(profile.perception)
    for number, (robot, _, reacting, watched, kin) in zip(count, steps.each, strict=True):
        end += number
        detection = detector.step(kin, robot, some_of(every, end - number, end), reacting, watched)
        rows.append([*detection.residual, detection.evidence])
    return np.array(rows)[:, :-1], np.array(rows)[:, -1]


@pytest.mark.slow
def test_pretouch_finds_what_a_test_finds_that_knows_the_covariance_and_not_what_one_finds_that_knows_the_place():
    place, covariance, pretouch = np.isfinite(np.vstack([delays(*arm) for arm in ARMS[::6]])).mean(axis=0)
    assert place > 0.95
    assert pretouch > covariance - 0.05


if __name__ == "__main__":
    every = np.vstack([delays(*arm) for arm in ARMS])
    print(len(every), np.isfinite(every).mean(axis=0), np.nanmedian(every, axis=0))
