"""Units of other programs become a skin: those that are links of a URDF, and those of tables of poses."""

import json

import numpy as np
import pytest
from tests.importing.made import BOX, joint, link, six_axis, written

from pretouch.cli import main
from pretouch.errors import SkinError
from pretouch.importing.read import read_robot
from pretouch.importing.robot_import import ImportOptions, import_robot, write_folder
from pretouch.importing.skin import chosen, fixed_links, mounted, units_of_links, units_of_table
from pretouch.robot.description import load_description, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.skin import load_skin, paper_skin

READY = "0,0.3,1.2,0,1.6,0"


def units(parent="link3", rpy="0 1.5708 0"):
    """Two units on a bracket that is fixed to a link, and one on the base."""
    places = {"bracket": (parent, "0 0 0.05", "0 0 0"), "prox_1": ("bracket", "0.06 0 0.05", rpy)}
    places |= {"prox_2": ("bracket", "-0.06 0 0.05", "0 -1.5708 0"), "mark": ("base", "0 0 0.3", "0 0 0")}
    return "".join(
        link(name, inertial="") + joint(f"to_{name}", on, name, "fixed", xyz=xyz, rpy=turn, limit="")
        for name, (on, xyz, turn) in places.items()
    )


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Folder of an imported arm without units."""
    folder = tmp_path_factory.mktemp("arm")
    options = ImportOptions(capsules=1, ready=tuple(map(float, READY.split(","))))
    write_folder(import_robot(written(folder, six_axis()), options), folder / "arm")
    return folder / "arm"


@pytest.fixture(scope="module")
def model(arm):
    return RobotModel(load_description(arm))


def test_units_of_a_urdf_are_where_it_has_them(tmp_path, arm, model, capsys):
    told = ["skin", "import", str(written(tmp_path, six_axis(units()))), "--arm", str(arm), "--links", "prox_*"]
    assert main([*told, "--sensor", "vl53l5cx", "--out", str(tmp_path / "s.toml"), "--json", str(tmp_path / "n")]) == 0
    skin = load_skin(tmp_path / "s.toml", model)
    assert [(unit.id, unit.link, unit.sensor.label) for unit in skin.mounted] == [
        ("prox_1", "link3", "vl53l5cx"),
        ("prox_2", "link3", "vl53l5cx"),
    ]
    poses = [unit.T_link_sensor for unit in skin.mounted]
    assert [pose[:3, 3].tolist() for pose in poses] == [pytest.approx([x, 0, 0.1], abs=1e-4) for x in (0.06, -0.06)]
    assert [pose[:3, 2].tolist() for pose in poses] == [pytest.approx([x, 0, 0], abs=1e-4) for x in (1, -1)]
    assert "Look into the arm" not in capsys.readouterr().out
    assert json.loads((tmp_path / "n").read_text())["units"][0]["outward"] == pytest.approx(1, abs=0.01)


def test_a_unit_that_looks_inwards_is_named_with_the_axis_that_looks_outwards(tmp_path, arm, capsys):
    file = written(tmp_path, six_axis(units(rpy="0 0 0").replace("0 -1.5708 0", "0 0 3.14159")))
    told = ["skin", "import", str(file), "--arm", str(arm), "--links", "prox_1,prox_2", "--out", str(tmp_path / "s")]
    assert main([*told, "--beam=-x"]) == 0
    assert "Look into the arm: prox_1, prox_2. With --beam=x, 2 of 2 look outwards." in (
        " ".join(capsys.readouterr().out.split())
    )
    assert main([*told, "--beam", "x"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main([*told, "--beam", "x", "--replace"]) == 0
    assert "into the arm" not in capsys.readouterr().out


def test_units_are_chosen_by_patterns_numbers_or_an_answer(tmp_path):
    names = fixed_links(read_robot(written(tmp_path, six_axis(units()))))
    assert names == {"bracket": "link3", "mark": "base", "prox_1": "bracket", "prox_2": "bracket", "tool0": "link6"}
    every, asked = list(names), list[str]()

    def answer(question):
        asked.append(question)
        return "2, 4-5"

    assert chosen(names, "", answer) == [every[1], every[3], every[4]]
    assert "prox_1, on bracket" in asked[0]
    assert sorted(chosen(names, "prox_?,mark", None)) == ["mark", "prox_1", "prox_2"]
    for patterns in ("camera_*", ""):
        with pytest.raises(SkinError, match=r"give --links a pattern of these: .*prox_1"):
            chosen(names, patterns, None)


def test_a_unit_on_a_link_that_the_arm_lacks_is_refused(tmp_path, model):
    robot = read_robot(written(tmp_path, six_axis(units("other") + link("other", BOX) + joint("o", "link6", "other"))))
    with pytest.raises(SkinError, match=r"prox_1 is fixed to other, which sixer does not have: import .* link6, tool0"):
        units_of_links(robot, model, ["prox_1"], PAPER_SENSOR)


def test_a_unit_within_its_links_capsule_is_raised_and_one_deep_inside_is_refused(tmp_path, arm, capsys):
    for x, code, words in ((0.03, 0, "Raised to the surface of the capsules"), (0.0, 2, "mm inside link3")):
        file = written(tmp_path, six_axis(units().replace("0.06 0 0.05", f"{x} 0 0.05")))
        told = [
            "skin",
            "import",
            str(file),
            "--arm",
            str(arm),
            "--links",
            "prox_1",
            "--out",
            str(tmp_path / f"{x}.toml"),
        ]
        assert main(told) == code
        assert words in "".join(capsys.readouterr())


CSV = "id,link,x,y,z,qx,qy,qz,qw\na,link3,0.06,0,0.1,0,0.7071068,0,0.7071068\n"
YAML = "skin:\n  units:\n    - {name: a, parent: link3, pose: {position: {x: 0.06, y: 0, z: 0.1}, orientation: "
TABLES = [
    ("csv", CSV),
    ("csv", "\ufeff# from CAD\nname;parent_link;x_mm;y_mm;z_mm;roll_deg;pitch_deg;yaw_deg\na;link3;60;0;100;0;90;0\n"),
    ("csv", "sensor_id\tframe_id\tpx\tpy\tpz\tnx\tny\tnz\na\tlink3\t0.06\t0\t0.1\t3\t0\t0\n"),
    ("yaml", YAML + "{x: 0, y: 0.7071068, z: 0, w: 0.7071068}}}\n"),
    ("yaml", "link3:\n  a: {xyz: [0.06, 0, 0.1], rpy: [0, 1.5707963, 0]}\n"),
    ("yml", "- {id: a, link: link3, position_mm: [60, 0, 100], quaternion_wxyz: [0.7071068, 0, 0.7071068, 0]}\n"),
    ("yaml", "sensors:\n  a: {link: link3, position: [0.06, 0, 0.1], normal: [1, 0, 0]}\n"),
]


@pytest.mark.parametrize(("suffix", "text"), TABLES)
def test_poses_of_tables_are_read_by_the_names_that_people_give_them(tmp_path, model, suffix, text):
    (row,) = units_of_table(written(tmp_path, text, f"units.{suffix}"), model, PAPER_SENSOR)
    one = mounted(row, model, "z")
    assert (one.unit.id, one.unit.link, one.raised) == ("a", "link3", 0.0)
    assert one.unit.T_link_sensor[:3, 2:] == pytest.approx(np.array([[1, 0.06], [0, 0], [0, 0.1]]), abs=1e-6)


@pytest.mark.parametrize(
    ("suffix", "text", "sentence"),
    [
        ("csv", CSV.replace("0.06", "0.06,0"), "line 2 has 10 values, and the header has 9"),
        ("csv", CSV.replace(",", ";").replace("0.06", "0,06"), "line 2: x is '0,06': give a number, with a decimal"),
        ("csv", CSV.replace("qx,qy,qz,qw", "a,b,c,d"), "line 2 has no complete pose: .* it has id, link, x"),
        ("csv", CSV.replace("link,", "where,"), "line 2 names no link: add link, one of base, link1"),
        ("csv", CSV.replace("0.7071068", "0"), "has no complete pose: .* not all zero"),
        ("csv", "", "holds no poses: give each unit id, link"),
        ("yaml", "a: {link: link3, xyz: [0.06, 0, 0.1], rpy: [0, 90, 0]}", "rpy_pitch is 90: give radians, or name it"),
        (
            "yaml",
            "a: {link: link3, xyz: [0.06, 0, 0.1], orientation: [0, 1, 0, 1]}",
            "4 numbers, not 3: name a quaternion quaternion_wxyz or",
        ),
        (
            "yaml",
            "skin:\n  link5: {kind: SPAD, sensors: 6, frame_prefix: link5_sensor_}",
            "holds no poses.* by --links",
        ),
        ("yaml", "a: [", "cannot be read: .*: give a URDF, or a CSV or YAML file of poses"),
    ],
)
def test_a_table_that_is_not_right_is_refused_with_the_place(tmp_path, model, suffix, text, sentence):
    with pytest.raises(SkinError, match=sentence):
        units_of_table(written(tmp_path, text, f"units.{suffix}"), model, PAPER_SENSOR)


def test_the_papers_skin_comes_back_from_a_table_of_its_poses(tmp_path):
    skin = paper_skin(RobotModel(panda()))
    text = "".join(
        f"{unit.id}: {{link: {unit.link}, position: {unit.T_link_sensor[:3, 3].tolist()}, normal:"
        f" {unit.T_link_sensor[:3, 2].tolist()}}}\n"
        for unit in skin.mounted
    )
    model = RobotModel(panda())
    found = units_of_table(written(tmp_path, text, "s.yaml"), model, PAPER_SENSOR)
    for row, unit in zip(found, skin.mounted, strict=True):
        one = mounted(row, model, "z")
        assert one.unit.T_link_sensor[:3, 2:] == pytest.approx(unit.T_link_sensor[:3, 2:], abs=1e-9)
        assert one.outward > 0.7
