"""What is wrong with a robot's file is said in one sentence with the way out."""

import numpy as np
import pytest
from tests.importing.made import BOX, joint, link, six_axis, written

from pretouch.errors import RobotModelError
from pretouch.importing.chain import arm_of, limits_of
from pretouch.importing.read import read_robot


def arm(folder, text, ee=""):
    return arm_of(read_robot(written(folder, text)), ee)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<robot", "is not valid XML"),
        ("<sdf/>", "starts with <sdf>: give a URDF"),
        ("<robot name='r'/>", "There is no robot in it, for no joint moves"),
        (
            f"<robot name='r'>{link('a')}{link('b')}{joint('j', 'a', 'b')}{joint('k', 'b', 'a')}</robot>",
            "cannot be read",
        ),
        (f"<robot name='r'>{link('a')}{link('a')}</robot>", "repeated URDF name"),
        (six_axis(changed={2: {"kind": "screw"}}), "invalid joint type in URDF joint definition"),
        (six_axis(changed={2: {"xyz": "0 nan 0"}}), "joint2: xyz of <origin> is '0 nan 0': give finite numbers"),
        (six_axis(changed={2: {"limit": '<limit lower="low"/>'}}), "could not convert string to float: 'low'"),
        (six_axis(changed={2: {"limit": '<limit velocity="1"/>'}}), "joint2 has the range 0 to 0, but only .* limit"),
        (six_axis(changed={4: {"kind": "prismatic"}}), "joint4 is prismatic, but only hinges .* --ee, such as link3"),
        (six_axis(changed={4: {"more": '<mimic joint="joint3"/>'}}), "The joint joint4 mimics another one.*--ee"),
        (six_axis().replace("0.08 0.08 0.2", "0 1 1", 1), "size 0 must be positive in geom"),
    ],
)
def test_a_broken_urdf_is_refused_in_one_sentence(tmp_path, text, sentence):
    with pytest.raises(RobotModelError, match=sentence) as caught:
        arm(tmp_path, text)
    said = str(caught.value)
    assert "\n" not in said
    assert ".." not in said
    assert "arm.urdf" in said or "joint" in said


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(RobotModelError, match=r"nowhere.urdf cannot be read: No such file"):
        read_robot(tmp_path / "nowhere.urdf")


def test_an_end_effector_that_nothing_moves_is_refused(tmp_path):
    with pytest.raises(RobotModelError, match="No joint moves base: choose another end-effector by --ee, such as"):
        arm(tmp_path, six_axis(), "base")


def test_the_tool_frame_is_taken_for_the_end_effector(tmp_path):
    found = arm(tmp_path, six_axis(link("camera", inertial="") + joint("c", "link6", "camera", "fixed")))
    assert found.robot.links[found.ee].name == "tool0"
    assert [j.name for j in found.joints] == [f"joint{k}" for k in range(1, 7)]
    assert "choose another one with --ee: camera" in found.robot.remarks[0]


@pytest.mark.parametrize(("joint_name", "link_name"), [("jointGripper", "mover"), ("j7", "upper_jaw")])
def test_a_single_finger_is_fixed_unless_asked_for(tmp_path, joint_name, link_name):
    more = link(link_name, BOX) + joint(joint_name, "link6", link_name, axis="0 1 0")
    found = arm(tmp_path, six_axis(more))
    assert [j.name for j in found.joints] == [f"joint{k}" for k in range(1, 7)]
    assert any(f"fixed at 0 or at the nearest limit: {joint_name}." in r for r in found.robot.remarks)
    assert [j.name for j in arm(tmp_path, six_axis(more), link_name).joints][-1] == joint_name


def test_a_last_link_called_gripper_is_the_arms(tmp_path):
    assert len(arm(tmp_path, six_axis().replace('"link6"', '"gripper"')).joints) == 6


def branching(before, after):
    """A robot whose only chain splits in two; two arms where there is nothing before."""
    parts, fork = [link("base")], f"t{before}" if before else "base"
    for name, last, count in (("t", "base", before), ("l", fork, after), ("r", fork, after)):
        for k in range(1, count + 1):
            parts += [link(f"{name}{k}"), joint(f"j{name}{k}", last, f"{name}{k}", axis=f"0 {k % 2} 1")]
            last = f"{name}{k}"
    return f"<robot name='split'>{''.join(parts)}</robot>"


def test_of_two_arms_one_has_to_be_chosen(tmp_path):
    with pytest.raises(RobotModelError, match="has 2 arms, or one that branches: choose one by --ee, such as l5, r5"):
        arm(tmp_path, branching(0, 5))
    chosen = arm(tmp_path, branching(0, 5), "r5")
    assert [j.name for j in chosen.joints] == [f"jr{k}" for k in range(1, 6)]
    assert "jl1, jl2" in chosen.robot.remarks[0]


def test_a_chain_that_branches_is_refused_with_the_ends_of_its_branches(tmp_path):
    with pytest.raises(RobotModelError, match="or one that branches: choose one by --ee, such as l3, r3"):
        arm(tmp_path, branching(3, 3))
    assert [j.name for j in arm(tmp_path, branching(3, 3), "r3").joints] == ["jt1", "jt2", "jt3", "jr1", "jr2", "jr3"]
    # two fingers of a whole arm are no branches to choose from
    whole = arm(tmp_path, branching(6, 1))
    assert [j.name for j in whole.joints] == [f"jt{k}" for k in range(1, 7)]
    assert "jl1, jr1" in whole.robot.remarks[-1]


@pytest.mark.parametrize("limit", ["", '<limit lower="-2" upper="2"/>'])
def test_limits_that_are_missing_are_assumed_with_a_sentence(tmp_path, limit):
    found = arm(tmp_path, six_axis(changed={1: {"kind": "continuous", "limit": limit}}))
    limits, unused = limits_of(found), "The position limits of joint1 are not used: it is continuous."
    assert (unused in found.robot.remarks) is bool(limit)
    assert limits.q_max[0] == pytest.approx(2 * np.pi)
    assert limits.qd_max.tolist() == [1.0, 2.0, 2.0, 2.0, 2.0, 2.0]
    said = " ".join(found.robot.remarks)
    for part in ("no usable position limits of joint1: -2 pi to 2 pi", "give each a lower and an upper one",
                 "velocity limit of joint1: 1 rad/s", "acceleration limit of all joints",
                 "give --qdd-max", "torque limit of joint1: 50 Nm"):  # fmt: skip
        assert part in said


@pytest.mark.parametrize("given", [(1.0, 2.0), (-1.0,), (np.nan,), (0.0,)])
def test_limits_given_badly_are_refused(tmp_path, given):
    with pytest.raises(RobotModelError, match=r"--qd-max is .*: give one positive number \[rad/s\], or 6"):
        limits_of(arm(tmp_path, six_axis()), qd_max=given)


def test_an_mjcf_may_include_files(tmp_path):
    body = '<body name="arm"><joint range="-1 1" limited="true"/><geom size=".1"/></body>'
    (tmp_path / "in.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    (tmp_path / "a.xml").write_text('<mujoco><include file="in.xml"/></mujoco>')
    assert [link.name for link in read_robot(tmp_path / "a.xml").links] == ["world", "arm"]
