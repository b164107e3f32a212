"""What an arm's MJCF may hold, before MuJoCo makes anything of it."""

import mujoco
import numpy as np
import pytest

from pretouch.errors import RobotModelError
from pretouch.robot.description import RobotDescription, fr3, panda
from pretouch.robot.description_file import description_text, load_description
from pretouch.robot.mjcf_check import check_mjcf
from pretouch.robot.model import RobotModel

CAPSULE = '<geom type="capsule" size=".1 .1"/>'
JOINT = '<joint range="-1 1" limited="true"/>'


def arm(inner: str = CAPSULE, beside: str = "", joint: str = JOINT) -> str:
    return f'<mujoco><worldbody><body name="tip">{joint}{inner}</body></worldbody>{beside}</mujoco>'


@pytest.mark.parametrize("described", [panda(), fr3()], ids=lambda one: one.name)
def test_our_own_arms_pass(described):
    check_mjcf(described.mjcf.read_bytes())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (arm('<replicate count="9999">' + CAPSULE + "</replicate>"), "an element <replicate>: leave it out, or make"),
        (arm('<flexcomp name="f" type="grid" count="99 99 99"/>'), "<flexcomp>"),
        (arm(beside='<size nkey="900000000"/>'), "<size>"),
        (arm(beside='<include file="/etc/passwd"/>'), "<include>"),
        (arm(beside='<asset><mesh file="/dev/zero"/></asset>'), "<mesh>"),
        (arm(beside='<sensor><user dim="999999999"/></sensor>'), "<sensor>"),
        (arm(beside='<actuator><motor joint="j" nsample="999999"/></actuator>'), "<motor> with the attribute nsample"),
        (arm('<site user="1 2 3"/>'), "<site> with the attribute user"),
        (arm(beside='<actuator><general gaintype="muscle" joint="j"/></actuator>'), "<general> with a muscle"),
        (arm(CAPSULE * 2000), "more than 2000 elements"),
        (arm(joint=JOINT * 65), "has 65 joints: give at most 64"),
        (arm(" " * 1_000_000), "larger than 1000000 bytes"),
        ("<mujoco", "not valid XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "document type"),
        ('<?xml version="1.0" encoding="utf-16"?><mujoco><size/></mujoco>', "<size>"),
    ],
)  # fmt: skip
def test_what_an_arm_does_not_need_never_reaches_mujoco(tmp_path, monkeypatch, text, message):
    (tmp_path / "arm.xml").write_text(text)
    one = RobotDescription("a", tmp_path / "arm.xml", "tip", *np.ones((4, 1)), "test")
    (tmp_path / "robot.toml").write_text(description_text(one))
    monkeypatch.setattr(mujoco.MjModel, "from_xml_path", lambda _path: pytest.fail("it was compiled"))
    with pytest.raises(RobotModelError, match=message) as told:
        RobotModel(load_description(tmp_path))
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("inner", "message"),
    [(CAPSULE * 201, "move 201 capsules of"), (CAPSULE.replace(".1 .1", "900 900"), r"1 capsules of 2\.04e\+07 m\^2")],
)
def test_a_body_far_larger_than_an_arm_is_refused_before_its_surface_is_made(tmp_path, inner, message):
    (tmp_path / "arm.xml").write_text(arm(inner))
    with pytest.raises(RobotModelError, match=message):
        RobotModel(RobotDescription("a", tmp_path / "arm.xml", "tip", *np.ones((4, 1)), "test"))
