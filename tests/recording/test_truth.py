"""What a simulation logged, gathered for a recording."""

from types import SimpleNamespace

import numpy as np

from pretouch.recording.codec import decode_truth, encode_truth
from pretouch.recording.truth import truth_of


def test_a_log_is_gathered_as_it_is() -> None:
    log = [(0.5, np.array([1.0, 2.0, 3.0])), (0.501, np.zeros(3))]
    touch = SimpleNamespace(time=0.501, link=4, velocity=np.array([0.0, 0.1, 0.0]))
    truth = truth_of(log, [touch], np.array([0.7, 0.0, 0.4]))
    assert truth.time.tolist() == [0.5, 0.501]
    assert truth.force.tolist() == [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]
    assert truth.hand.tolist() == [0.7, 0.0, 0.4]
    assert truth.touches == ((0.501, 4, touch.velocity),)


def test_without_a_hand_or_anything_logged_it_can_be_kept() -> None:
    truth = truth_of([], [], None)
    assert truth.force.shape == (0, 3)
    _, kept = decode_truth(encode_truth(3, truth))
    assert np.isnan(kept.hand).all()
    assert (len(kept.time), len(kept.touches)) == (0, 0)
