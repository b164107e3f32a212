"""Numbers and templates in other people's descriptions: of each kind one that users met, and others like it."""

import numpy as np
import pytest
from tests.importing.made import INERTIAL, link, six_axis, written
from tests.importing.test_robot_import import mjcf

from pretouch.errors import RobotModelError
from pretouch.importing.chain import arm_of, limits_of
from pretouch.importing.read import read_robot


def limited(limit, joints=range(1, 7), kind="revolute"):
    return six_axis(changed={k: {"limit": f"<limit {limit}/>", "kind": kind} for k in joints})


def imported(folder, text, name="arm.urdf", **options):
    found = arm_of(read_robot(written(folder, text, name)))
    return limits_of(found, **options), " ".join(found.robot.remarks)


BEST = 'velocity="2" effort="40"'


@pytest.mark.parametrize(
    "ends",
    [
        'lower="-inf" upper="inf"',
        'lower="-1.7976931348623157e+308" upper="1.7976931348623157e+308"',
        'lower="-1e16" upper="1e16"',
        'lower="-1e9" upper="1e9"',
        'lower="nan" upper="nan"',
        'lower="-1" upper="Infinity"',
    ],
)
def test_position_limits_that_mean_none_are_none(tmp_path, ends):
    limits, remarks = imported(tmp_path, limited(f"{ends} {BEST}", [1, 3]))
    assert "The file has no usable position limits of joint1, joint3: -2 pi to 2 pi is assumed" in remarks
    assert limits.q_max == pytest.approx([2 * np.pi, 2.8, 2 * np.pi, 2.8, 2.8, 2.8])
    assert limits.qd_max.tolist() == [2.0] * 6
    assert limits.tau_max.tolist() == [40.0] * 6


@pytest.mark.parametrize("none", ["inf", "1e9", "1.7976931348623157e+308", "0"])
def test_speeds_and_torques_that_mean_none_are_none_and_options_count(tmp_path, none):
    text = limited(f'lower="-2" upper="2" velocity="{none}" effort="{none}"')
    limits, remarks = imported(tmp_path, text)
    assert "no usable velocity limit of all joints: 1 rad/s" in remarks
    assert "no usable torque limit of all joints: 50 Nm" in remarks
    assert limits.qd_max.tolist() == [1.0] * 6
    limits, remarks = imported(tmp_path, text, qd_max=(2.0,), tau_max=(80.0,))
    assert "velocity" not in remarks
    assert (limits.qd_max.tolist(), limits.tau_max.tolist()) == ([2.0] * 6, [80.0] * 6)


@pytest.mark.parametrize(
    ("limit", "what", "sentence"),
    [
        (f'lower="-170" upper="170" {BEST}', "position", "joint1 (170 rad)"),
        (f'lower="-20" upper="65" {BEST}', "position", "joint1 (65 rad)"),
        ('lower="-170" upper="170" velocity="25" effort="80"', "velocity", "joint1 (25 rad/s)"),
        ('lower="-2" upper="2" velocity="110" effort="80"', "velocity", "joint1 (110 rad/s)"),
        ('lower="-2" upper="2" velocity="-35" effort="80"', "velocity", "joint1 (35 rad/s)"),
    ],
)
def test_degrees_are_named_and_not_used(tmp_path, limit, what, sentence):
    limits, remarks = imported(tmp_path, limited(limit))
    assert f"The {what} limits of {sentence}, joint2" in remarks
    assert "are not used, for no joint of an arm has such: they look like degrees in place of radians" in remarks
    assert limits.q_max.max() <= 2 * np.pi
    assert limits.qd_max.max() <= 2.0


def test_a_single_limit_and_torques_that_no_joint_has_are_of_another_unit(tmp_path):
    limits, remarks = imported(tmp_path, limited('lower="-90" upper="90" velocity="2" effort="9e5"', [3]))
    for part in (
        "position limits of joint3 (90 rad) are not used",
        "torque limits of joint3 (900000 Nm)",
        "another unit",
    ):
        assert part in remarks
    assert limits.tau_max.tolist() == [40, 40, 50, 40, 40, 40]


@pytest.mark.parametrize("end", [2.9, 6.28, 3.14159])
def test_radians_that_were_taken_for_degrees_are_named(tmp_path, end):
    text = mjcf().replace('range="-160 160"', f'range="-{end} {end}"')
    assert '<compiler angle="radian"/> says what they are' in imported(tmp_path, text, "arm.xml")[1]
    some = text.replace(f'range="-{end} {end}"', 'limited="false"', 1)
    assert "taken for degrees" in imported(tmp_path, some, "arm.xml")[1]
    assert "degrees" not in imported(tmp_path, mjcf(), "arm.xml")[1]


def first_inertial(inertial):
    return six_axis().replace(INERTIAL, inertial, 1)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (six_axis(changed={2: {"rpy": "90 0 0"}}), "joint2: rpy of <origin> is '90 0 0': give radians"),
        (six_axis().replace('<origin xyz="0 0 0.1"/>', '<origin rpy="0 180 0"/>', 1), "base: rpy of <origin>"),
        (six_axis(changed={2: {"xyz": "0 9 0"}}), "joint2: xyz of <origin> is '0 9 0': .* millimetres"),
        (first_inertial(INERTIAL.replace("<mass", '<origin xyz="0 12 0"/><mass')), "base: xyz of <origin>"),
        (six_axis(changed={2: {"xyz": "0 0,15 0"}}), "joint2: xyz of <origin> is '0 0,15 0': give decimal points"),
        (first_inertial(INERTIAL.replace('"2"', '"1,5"')), "base|could not convert string to float: '1,5'"),
        (mjcf().replace('pos="0.02 0.01 0.25"', 'pos="20 10 250"'), "b2 is more than 5 m from its parent: give metres"),
        (mjcf().replace('angle="degree"', 'angle="radian"'), r"b1: euler is \[0.0, 0.0, 10.0\] radians"),
        (mjcf().replace('euler="0 0 10"', 'euler="0 1.5708 -3.14159"'), "b1: euler is .* degrees: .* radians"),
    ],
)
def test_origins_of_another_unit_are_refused(tmp_path, text, sentence):
    with pytest.raises(RobotModelError, match=sentence):
        read_robot(written(tmp_path, text, "arm.xml" if text.startswith("<mujoco") else "arm.urdf"))


def test_an_origin_turned_by_a_whole_turn_is_read(tmp_path):
    assert read_robot(written(tmp_path, six_axis(changed={2: {"rpy": "0 0 -6.2832"}}))).remarks == []


def test_inertias_that_are_not_finite_keep_the_mass(tmp_path):
    robot = read_robot(written(tmp_path, first_inertial(INERTIAL.replace('ixx=".02"', 'ixx="nan"'))))
    assert robot.beside.mass == {"base": 2.0}


XACRO = ' xmlns:xacro="http://www.ros.org/wiki/xacro"'
TEMPLATES = [
    six_axis(changed={4: {"rpy": "0 0 ${pi/2}"}}),
    six_axis(changed={4: {"limit": '<limit lower="${-pi}" upper="${pi}"/>'}}),
    six_axis().replace('"link3"', '"${prefix}link3"'),
    six_axis().replace("<box size=", '<mesh filename="file://$(find my_arm)/a.stl"/><box size=', 1),
    six_axis().replace('name="sixer"', f'name="sixer"{XACRO}').replace("</robot>", '<xacro:arm prefix=""/></robot>'),
    six_axis("<group><xacro:macro name='arm'/></group>"),
    six_axis()
    .replace('name="sixer"', f'name="sixer"{XACRO.replace("xacro=", "x=")}')
    .replace("</robot>", "<x:if/></robot>"),
]


@pytest.mark.parametrize("text", TEMPLATES)
def test_xacro_that_is_left_is_said_before_any_number_is_read(tmp_path, text, monkeypatch):
    monkeypatch.setattr("pretouch.importing.read.find_spec", lambda _: None)
    with pytest.raises(
        RobotModelError, match=r"Xacro is left in .*arm.urdf: install xacrodoc .* or make .* `xacro arm"
    ):
        read_robot(written(tmp_path, text))
    remark = "<!-- was ${pi/2}, $(find my_arm) and xacro:macro before -->"
    assert read_robot(written(tmp_path, six_axis(remark))).remarks == []


def test_another_undefined_prefix_is_not_taken_for_xacro(tmp_path):
    with pytest.raises(RobotModelError, match="is not valid XML: unbound prefix"):
        read_robot(written(tmp_path, six_axis("<gazebo:plugin/>")))


def test_xacro_is_expanded_with_its_arguments_where_a_package_is_installed(tmp_path):
    file = written(tmp_path, TEMPLATES[0].replace("sixer", "$(arg name)"), "arm.xacro")
    with pytest.raises(RobotModelError, match=r"cannot be expanded: .* give its arguments by --xacro NAME:=VALUE"):
        read_robot(file)
    robot = read_robot(file, (), ("name:=mine",))
    assert (robot.name, robot.remarks) == ("mine", ["The xacro in the file was expanded."])
    (tmp_path / "macros/my_macros").mkdir(parents=True)
    (tmp_path / "macros/my_macros/package.xml").write_text("<package><name>my_macros</name></package>")
    macro = f'<robot{XACRO}><xacro:macro name="more" params="name"><link name="${{name}}"/></xacro:macro></robot>'
    (tmp_path / "macros/my_macros/m.xacro").write_text(macro)
    use = '<xacro:include filename="$(find my_macros)/m.xacro"/><xacro:more name="cover"/>'
    text = six_axis(use).replace("<robot", f"<robot{XACRO}").replace("</robot>", "")
    text += '<joint name="c" type="fixed"><parent link="link6"/><child link="cover"/></joint></robot>'
    assert "cover" in [one.name for one in read_robot(written(tmp_path, text), (tmp_path / "macros",)).links]


def test_a_part_of_another_mjcf_file_is_called_one(tmp_path):
    scene = "<worldbody><geom type='plane' size='1 1 1'/></worldbody>"
    for text in ("<asset><mesh name='m' file='link1.stl'/></asset>", scene, "<default><joint damping='1'/></default>"):
        with pytest.raises(RobotModelError, match=r"no robot in it.*: is it a part of another file"):
            read_robot(written(tmp_path, f"<mujoco>{text}</mujoco>", "part.xml"))


def test_a_negative_mass_is_named_and_a_mass_alone_is_kept(tmp_path):
    text = six_axis().replace(
        link("tool0", inertial=""), link("tool0", inertial='<inertial><mass value="1.5"/></inertial>')
    )
    assert read_robot(written(tmp_path, text)).beside.mass == {"tool0": 1.5}
