"""The posture to start from, where an arm's make leaves some of its links little room in any posture."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.importing.ready import proposed
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import ever_apart

LUMP = '<geom name="lump" size="0.03 0.001" pos="0 0 0.24" type="capsule" mass="0"/>'


@pytest.fixture(scope="module")
def lumpy(tmp_path_factory) -> RobotModel:
    """A Panda with a lump on its base, 13 to 17 mm below the second link whatever the posture, as a UR10e's base is."""
    text, first = panda().mjcf.read_text(), '<geom name="link0_0"'
    assert text.count(first) == 1
    mjcf = tmp_path_factory.mktemp("lumpy") / "arm.xml"
    mjcf.write_text(text.replace(first, LUMP + first))
    return RobotModel(replace(panda(), mjcf=mjcf))


def test_pairs_that_never_come_far_apart_are_told_from_the_others(lumpy):
    little = ever_apart(lumpy) & ~ever_apart(lumpy, 0.02)
    pairs = [[lumpy.links[lumpy.capsules.link[c]] for c in pair] for pair in lumpy.apart[little]]
    assert pairs == [["panda_link0", "panda_link2"]]


@pytest.mark.slow
def test_they_keep_no_arm_from_a_posture_with_its_hand_down(lumpy):
    remarks = list[str]()
    ready = proposed(lumpy, remarks)
    assert remarks == []
    assert np.all((ready.q > lumpy.q_min) & (ready.q < lumpy.q_max))
    assert ready.clear >= 0.01  # of the pairs that can come apart
