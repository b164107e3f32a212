"""What is wrong with a robot's file is said in one sentence with the way out."""

import re

import numpy as np
import pytest
from tests.importing.made import BOX, joint, link, six_axis, written

from pretouch.errors import MissingExtraError, RobotModelError
from pretouch.importing.chain import arm_of, limits_of
from pretouch.importing.read import read_mesh, read_robot


def link_of(robot, name="base"):
    return robot.links[robot.index(name)]


def arm(folder, text, ee=""):
    return arm_of(read_robot(written(folder, text)), ee)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<robot", "is not valid XML"),
        ("<sdf/>", "starts with <sdf>: give a URDF"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="x"/></robot>',
            "Xacro is left in the file .*: make a URDF of it by `xacro arm.urdf",
        ),
        ("<robot name='r'/>", "There is no robot in it, for no joint moves"),
        (
            f"<robot name='r'>{link('a')}{link('b')}{joint('j', 'a', 'b')}{joint('k', 'b', 'a')}</robot>",
            "cannot be read",
        ),
        (f"<robot name='r'>{link('a')}{link('a')}</robot>", "repeated URDF name"),
        (six_axis(changed={2: {"kind": "screw"}}), "invalid joint type in URDF joint definition"),
        (six_axis(changed={2: {"xyz": "0 nan 0"}}), "joint2: xyz of <origin> is '0 nan 0': give finite numbers"),
        (six_axis(changed={2: {"xyz": "0 9 0"}}), "joint2: xyz of <origin> is '0 9 0': .* millimetres"),
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
    found = arm(tmp_path, six_axis().replace('"link6"', '"gripper"'))
    assert len(found.joints) == 6


def test_limits_that_no_joint_has_are_named(tmp_path):
    huge = '<limit lower="-900000" upper="900000" velocity="900" effort="9e5"/>'
    found = arm(tmp_path, six_axis(changed={3: {"limit": huge}}))
    limits_of(found)
    for what, value in (("position", "900000 rad"), ("velocity", "900 rad/s"), ("torque", "900000 Nm")):
        assert any(r.startswith(f"Implausible {what} limits") and f"joint3 ({value})" in r for r in found.robot.remarks)
    sound = arm(tmp_path, six_axis())
    limits_of(sound)
    assert not any("Implausible" in r for r in sound.robot.remarks)


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


def mesh_arm(uri):
    return six_axis().replace('<box size="0.08 0.08 0.2"/>', f'<mesh filename="{uri}" scale="0.001 0.001 0.001"/>')


ASCII_STL = (
    "solid x\n"
    + "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 100 0 0\nvertex 0 50 0\nendloop\nendfacet\n"
    + "endsolid\n"
)
OBJ = "# a corner\nv 0 0 0\nv 100 0 0\nv 100 50 0\nv 0 50 0\nf 1/1 2/2 3/3 4/4\n"


@pytest.mark.parametrize(
    ("uri", "place"),
    [
        ("package://my_arm/meshes/a.stl", "my_arm/meshes/a.stl"),
        ("package://my_arm/meshes/a.obj", "my_arm/meshes/a.obj"),
        ("meshes/a.stl", "my_arm/urdf/meshes/a.stl"),
        ("../meshes/a.OBJ", "my_arm/meshes/a.OBJ"),
    ],
)
def test_meshes_are_found_by_package_and_by_relative_path(tmp_path, uri, place):
    urdf, mesh = tmp_path / "my_arm" / "urdf", tmp_path / place
    for folder in (urdf, mesh.parent):
        folder.mkdir(parents=True, exist_ok=True)
    mesh.write_text(OBJ if uri.lower().endswith("obj") else ASCII_STL)
    found = read_robot(written(urdf, mesh_arm(uri)))
    surface = link_of(found).surface()
    assert surface.vertices.max(axis=0) == pytest.approx([0.1, 0.05, 0.1])


def test_a_package_is_found_in_the_path_given(tmp_path):
    (tmp_path / "elsewhere" / "my_arm").mkdir(parents=True)
    (tmp_path / "elsewhere" / "my_arm" / "a.stl").write_text(ASCII_STL)
    (tmp_path / "here").mkdir()
    file = written(tmp_path / "here", mesh_arm("package://my_arm/a.stl"))
    with pytest.raises(RobotModelError, match="give --package-path the folder that holds the package my_arm"):
        link_of(read_robot(file)).surface()
    with pytest.raises(RobotModelError, match=r"The mesh a{300}\.stl was not found: put it at"):
        link_of(read_robot(written(tmp_path, mesh_arm(f"{'a' * 300}.stl")))).surface()
    for folder in (tmp_path / "elsewhere", tmp_path / "elsewhere" / "my_arm"):
        assert len(link_of(read_robot(file, (folder,))).surface().faces) == 1


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.stl", b"", "or is truncated"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\n", "or is truncated"),
        ("a.stl", ASCII_STL[:-12].encode(), "or is truncated"),
        ("a.stl", ASCII_STL.replace("0 50 0", "0 50 zero").encode(), "is damaged: .* could not be read to its end"),
        ("a.stl", ASCII_STL.replace("0 50 0", "0 50").encode(), "is damaged: incorrect number of vertices"),
        ("a.stl", ASCII_STL.replace("0 50 0", "50 0 0").encode(), "no triangle with an area"),
        ("a.stl", ASCII_STL.replace("100", "nan").encode(), "finite corners"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "is damaged: index 1 is out of bounds"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "is damaged: its faces do not count"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 9 9 9\n", "from 1 onwards: save it anew"),
        ("a.dae", b"<COLLADA", "is damaged|extra 'meshes'"),
        ("a.passwd", b"root:x", "has an unknown format: use .stl, .obj, .dae"),
    ],
)
def test_a_broken_mesh_is_refused_in_one_sentence(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises((RobotModelError, MissingExtraError), match=sentence) as caught:
        read_mesh(tmp_path / name)
    assert re.search(re.escape(name), str(caught.value))
    assert "root:x" not in str(caught.value)


def test_a_binary_stl_is_read(tmp_path):
    record = np.zeros(2, np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    record["c"][0] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    record["c"][1] = [[1, 0, 0], [1, 1, 0], [0, 1, 0]]
    file = tmp_path / "a.stl"
    file.write_bytes(b"solid but binary".ljust(80) + (2).to_bytes(4, "little") + record.tobytes())
    surface = read_mesh(file)
    assert surface.triangles == pytest.approx(record["c"])


def test_an_mjcf_may_include_files(tmp_path):
    body = '<body name="arm"><joint range="-1 1" limited="true"/><geom size=".1"/></body>'
    (tmp_path / "in.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    (tmp_path / "a.xml").write_text('<mujoco><include file="in.xml"/></mujoco>')
    assert [link.name for link in read_robot(tmp_path / "a.xml").links] == ["world", "arm"]
