"""A robot's file becomes a folder that everything else takes, and nothing is lost on the way."""

from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from tests.importing.made import BOX, joint, link, six_axis, small, written

from pretouch.errors import RobotModelError
from pretouch.importing.robot_import import ImportOptions, import_robot, write_folder
from pretouch.robot.description import load_description
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import capsule_ends, kinematics_of, self_distances

READY = (0.0, 0.3, 1.2, 0.0, 1.6, 0.0)
BARE = six_axis().replace(BOX, "<geometry/>", 5)
"""An arm of which only the last links have a shape."""


def quickly(folder, text, **options):
    """Import a text with one capsule a link and a ready posture."""
    return import_robot(written(folder, text), ImportOptions(ready=READY, capsules=1, **options))


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return written(tmp_path_factory.mktemp("source"), six_axis())


@pytest.fixture(scope="module")
def imported(source):
    return import_robot(source, ImportOptions())


@pytest.fixture(scope="module")
def folder(imported, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "sixer"
    assert write_folder(imported, out) is None
    return out


@pytest.fixture(scope="module")
def model(folder):
    return RobotModel(load_description(folder))


def test_the_folder_holds_an_arm_of_capsules_with_what_the_file_says(model, folder):
    description = model.description
    assert (description.name, description.ee_body, model.n) == ("sixer", "tool0", 6)
    assert description.qd_max.tolist() == [2.0] * 6
    assert description.tau_max.tolist() == [40.0] * 6
    assert model.q_min == pytest.approx(np.full(6, -2.8))
    assert description.source == "imported from arm.urdf"
    root = ET.parse(folder / "arm.xml").getroot()  # noqa: S314  our own
    assert {geom.get("type") for geom in root.iter("geom")} == {"capsule"}
    assert not list(root.iter("mesh"))


def stripped(file):
    """The URDF as MuJoCo's own reader takes it: no shapes, and no bodies joined."""
    root = ET.parse(file).getroot()  # noqa: S314  our own
    for element in root.findall("link"):
        for what in ("collision", "visual"):
            for shape in element.findall(what):
                element.remove(shape)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false", discardvisual="false")
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def assert_same_mechanics(model, oracle, shift=()):
    """Poses and dynamics as MuJoCo has them from the source itself."""
    data, rng = mujoco.MjData(oracle), np.random.default_rng(1)
    for q in rng.uniform(model.q_min, model.q_max, (20, model.n)):
        data.qpos[: model.n] = q
        mujoco.mj_forward(oracle, data)
        kin = model.kinematics(q)
        for b in range(1, oracle.nbody):
            at = model.link_index(oracle.body(b).name)
            assert kin.position[at] == pytest.approx(data.xpos[b], abs=1e-5)
            assert kin.rotation[at] == pytest.approx(data.xmat[b].reshape(3, 3), abs=1e-5)
        mass = np.zeros((oracle.nv, oracle.nv))
        mujoco.mj_fullM(oracle, data, mass)
        own_mass, gravity = model.mass_matrix_and_bias(q, np.zeros(model.n), np.zeros(model.n))
        assert own_mass == pytest.approx(mass[: model.n, : model.n], rel=1e-5, abs=1e-6)
        assert gravity == pytest.approx(data.qfrc_bias[: model.n], rel=1e-5, abs=1e-4)


def test_poses_and_dynamics_are_those_of_the_source(model, source):
    assert_same_mechanics(model, stripped(source))


def test_the_ready_posture_is_a_good_one(model, imported):
    q = model.description.q_ready
    kin = model.kinematics(q)
    assert (np.minimum(q - model.q_min, model.q_max - q) > 0.2).all()
    smallest = np.linalg.svd(model.ee_jacobian(kin), compute_uv=False)[-1]
    assert imported.ready.singular_value == pytest.approx(smallest)
    assert smallest > 0.05
    assert kin.position[model.ee, 0] > 0.2
    assert kin.rotation[model.ee][:, 2] == pytest.approx([0, 0, -1], abs=1e-3)
    assert self_distances(model, capsule_ends(model, kinematics_of(model, q[None]))).min() > 0.0099


@pytest.mark.slow
def test_a_small_arm_with_a_hand_that_turns_about_itself_gets_a_ready_posture(tmp_path):
    found = import_robot(written(tmp_path, small()), ImportOptions(capsules=1))
    kin, ee = found.model.kinematics(found.ready.q), found.model.ee
    assert kin.rotation[ee][:, 2] == pytest.approx([0, 0, -1], abs=1e-3)
    assert kin.position[ee, 0] > 0.2
    assert found.ready.clear > 0.0099
    assert not any("No posture was found" in r for r in found.remarks)


def test_where_no_hand_points_down_the_import_says_so_and_is_written(tmp_path):
    kept = '<limit lower="-0.05" upper="0.05" velocity="2" effort="40"/>'
    file = written(tmp_path, six_axis(changed={k: {"limit": kept} for k in range(1, 7)}).replace(BOX, "<geometry/>", 5))
    found = import_robot(file, ImportOptions(capsules=1))
    assert any("No posture was found with the hand in front" in r and "--ready" in r for r in found.remarks)
    write_folder(found, tmp_path / "out")
    assert RobotModel(load_description(tmp_path / "out")).n == 6


def test_a_ready_posture_outside_the_limits_is_refused(source):
    for ready in ((0.0, 9.0, 0.0, 0.0, 0.0, 0.0), (0.0,) * 5, (np.nan,) * 6):
        with pytest.raises(RobotModelError, match=r"--ready is .*: give 6 joint positions"):
            import_robot(source, ImportOptions(ready=ready))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            six_axis().replace('<box size="0.08 0.08 0.2"/>', '<box size="80 80 200"/>', 1),
            r'The link base is 200 m long: .* the scale "0.001 0.001 0.001"',
        ),
        (six_axis().replace(BOX, "<geometry/>"), "No moving link of sixer has any geometry: give"),
    ],
)
def test_shapes_in_millimetres_or_none_at_all_are_refused(tmp_path, text, sentence):
    with pytest.raises(RobotModelError, match=sentence):
        quickly(tmp_path, text)


def test_masses_and_inertias_that_no_link_has_are_named(tmp_path):
    text = BARE.replace('<mass value="2"/>', '<mass value="500000"/>', 1).replace('izz=".01"', 'izz="9"', 1)
    remarks = " ".join(quickly(tmp_path, text).remarks)
    assert "Implausible masses, correct them in the file: base (500000 kg)" in remarks
    assert "The inertia of base is impossible" in remarks


def test_a_broken_mesh_is_said_before_the_first_link_is_fitted(tmp_path, monkeypatch):
    monkeypatch.setattr("pretouch.importing.capsules.fitted", lambda *_: pytest.fail("fitted"))
    text = six_axis()
    at = text.rindex(BOX)
    with pytest.raises(RobotModelError, match=r"The mesh none.stl was not found"):
        import_robot(
            written(tmp_path, text[:at] + '<geometry><mesh filename="none.stl"/></geometry>' + text[at + len(BOX) :]),
            ImportOptions(ready=READY),
        )


def test_capsules_that_cover_have_nothing_stick_out(tmp_path):
    found = quickly(tmp_path, BARE, cover=True)
    assert max(body.sticks_out for body in found.bodies) < 1e-9


def test_links_without_mass_or_inertia_are_estimated_from_their_capsules(tmp_path):
    ball, text = '<geometry><sphere radius="0.1"/></geometry>', six_axis()
    wrong = '<inertial><mass value="-2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    for k, inertial in ((3, ""), (4, '<inertial><mass value="2"/></inertial>'), (5, wrong)):
        text = text.replace(link(f"link{k}", BOX), link(f"link{k}", ball, inertial))
    found = quickly(tmp_path, text.replace(BOX, "<geometry/>"))
    links, (remark,) = found.model.mechanism.links, [r for r in found.remarks if "mass and inertia in the file" in r]
    assert "at 1000 kg/m^3: link3 (4.2 kg), link4 (inertia only, of 2 kg), link5 (-2 kg in the file, 4.2 kg)." in remark
    for name, kg in (("link3", 4.19), ("link4", 2.0), ("link5", 4.19)):
        at = found.model.link_index(name)
        assert links.mass[at] == pytest.approx(kg, rel=0.01)
        assert links.inertia[at] == pytest.approx(0.4 * kg * 0.1**2 * np.eye(3), rel=0.01)


def test_fingers_are_fixed_nearest_to_zero_and_visual_shapes_and_a_link_called_world_are_taken(tmp_path):
    slide = '<limit lower="0.01" upper="0.04" velocity="1" effort="1"/>'
    more = link("left", BOX, what="visual") + joint("f1", "link6", "left", "prismatic", "0 1 0", limit=slide)
    more += link("right") + joint("f2", "link6", "right", "prismatic", limit=slide, more='<mimic joint="f1"/>')
    more += link("world", inertial="") + joint("w", "world", "base", "fixed")
    found = quickly(tmp_path, six_axis(more).replace(BOX, "<geometry/>", 6))
    model, remarks = found.model, " ".join(found.remarks)
    assert model.links[:2] == ("world", "base")
    assert "fitted to the visual geometry: left" in remarks
    assert "Joints off the arm, fixed at 0 or at the nearest limit: f1, f2" in remarks
    kin, hand, left = model.kinematics(np.zeros(6)), model.link_index("link6"), model.link_index("left")
    assert left in model.capsules.link
    offset = kin.rotation[hand].T @ (kin.position[left] - kin.position[hand])
    assert offset == pytest.approx([0.0, 0.01, 0.2], abs=1e-5)


MJCF = """<mujoco model="mj"><compiler angle="degree"/><worldbody><geom type="plane" size="1 1 1"/><body name="base">
<geom type="box" size=".05 .05 .05"/>{body}</body></worldbody>
<actuator><motor joint="j1" gear="10" ctrlrange="-1 1" forcerange="-3 3" forcelimited="true"/></actuator></mujoco>"""


def mjcf():
    body = ""
    for k, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1"), 1):
        place = "0.02 0.01 0.25" if k > 1 else "0 0 0.1"
        body += (
            f'<body name="b{k}" pos="{place}" euler="0 0 10"><joint name="j{k}" axis="{axis}" pos="0.01 0 -0.02"'
            f' range="-160 160" ref="{5 * (k == 2)}"/><geom type="cylinder" size=".03 .08" pos="0 0 .08" mass="1"/>'
        )
    return MJCF.format(body=body + '<body name="tip" pos="0 0 .2"/>' + "</body>" * 6)


@pytest.mark.slow
def test_an_mjcf_file_keeps_its_mechanics(tmp_path):
    file = written(tmp_path, mjcf(), "arm.xml")
    found = import_robot(file, ImportOptions(ready=READY, capsules=1))
    assert found.model.description.ee_body == "tip"
    assert found.model.description.tau_max[:2].tolist() == [30.0, 50.0]
    assert_same_mechanics(found.model, mujoco.MjModel.from_xml_path(str(file)))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>", "arm.xml cannot be read"),
        ("<mujoco/>", "There is no robot in it, for no joint moves"),
        (mjcf().replace('name="j3"', 'name="j3" type="slide"'), "j3 is prismatic"),
        (
            mjcf().replace('name="j3"', 'name="j3" type="ball"').replace('axis="0 1 0"', "", 2),
            "cannot be read|not a hinge",
        ),
    ],
)
def test_a_broken_mjcf_is_refused_in_one_sentence(tmp_path, text, sentence):
    with pytest.raises(RobotModelError, match=sentence) as caught:
        import_robot(written(tmp_path, text, "arm.xml"), ImportOptions())
    assert "\n" not in str(caught.value)
