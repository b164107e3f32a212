"""Mesh files are found where people lay them, and what is wrong with one is said in one sentence."""

import re

import numpy as np
import pytest
from tests.importing.made import six_axis, written

from pretouch.errors import MissingExtraError, RobotModelError
from pretouch.importing.meshes import read_mesh
from pretouch.importing.read import read_robot

ASCII_STL = (
    "solid x\n"
    + "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 100 0 0\nvertex 0 50 0\nendloop\nendfacet\n"
    + "endsolid\n"
)
OBJ = "# a corner\nv 0 0 0\nv 100 0 0\nv 100 50 0\nv 0 50 0\nf 1/1 2/2 3/3 4/4\n"
RECORD = np.zeros(2, np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
RECORD["c"] = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]]
BINARY = b"solid but binary".ljust(80) + (2).to_bytes(4, "little") + RECORD.tobytes()


def surface(folder, uri, packages=()):
    """Surface of an arm's base with a mesh, and the remarks on it."""
    mesh = f'<mesh filename="{uri}" scale="0.001 0.001 0.001"/>'
    folder.mkdir(parents=True, exist_ok=True)
    robot = read_robot(written(folder, six_axis().replace('<box size="0.08 0.08 0.2"/>', mesh, 1)), packages)
    return robot.links[robot.index("base")].surface(), robot.remarks


def laid(folder, *places):
    """Put a mesh at some places below a folder."""
    for place in places:
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(OBJ if place.lower().endswith("obj") else ASCII_STL)


@pytest.mark.parametrize(
    ("uri", "place"),
    [
        ("package://my_arm/meshes/a.stl", "my_arm/meshes/a.stl"),
        ("package://my_arm/meshes/a%20b.stl", "my_arm/meshes/a b.stl"),
        (r"package://my_arm\meshes\a.obj", "my_arm/meshes/a.obj"),
        ("meshes/a.stl", "my_arm/urdf/meshes/a.stl"),
        ("../meshes/a.OBJ", "my_arm/meshes/a.OBJ"),
        ("file://localhost{}/my_arm/a.stl", "my_arm/a.stl"),
    ],
)
def test_meshes_are_found_by_package_and_by_path(tmp_path, uri, place):
    laid(tmp_path, place)
    found, remarks = surface(tmp_path / "my_arm" / "urdf", uri.format(tmp_path))
    assert found.vertices.max(axis=0) == pytest.approx([0.1, 0.05, 0.1])
    assert remarks == []


@pytest.mark.parametrize(
    ("uri", "place"),
    [
        ("Package://my_arm//meshes/link3.stl", "ws/src/my_arm/meshes/Link3.STL"),
        ("package://My_Arm/meshes/a.stl", "ws/install/my_arm/share/my_arm/meshes/a.stl"),
        ("file:///home/user/ws/install/my_arm/share/my_arm/meshes/a.stl", "stack/my_arm/meshes/a.stl"),
        ("/opt/ros/humble/share/my_arm/meshes/deep/visual/a.stl", "my_arm/meshes/deep/visual/a.stl"),
        (r"file:///C:\Users\me\my_arm\meshes\a.stl", "my_arm/meshes/a.stl"),
        ("meshes/a.stl", "elsewhere/meshes/a.stl"),
        ("package://my_arm/a.stl", "my_arm-main/a.stl"),
    ],
)
def test_a_mesh_that_is_elsewhere_is_taken_where_it_is_the_only_one(tmp_path, uri, place):
    laid(tmp_path / "given", place, "other/meshes/visual/b.stl")
    if "main" in place:  # a clone under another name
        (tmp_path / "given/my_arm-main/package.xml").write_text("<package><name>my_arm</name></package>")
    found, (remark,) = surface(tmp_path / "far", uri, (tmp_path / "given",))
    assert len(found.faces) == 1
    assert f"not where the file says: those of the same names in {(tmp_path / 'given' / place).parent}" in remark


def test_a_mesh_that_is_not_found_is_said_with_the_places_and_what_is_alike(tmp_path, monkeypatch):
    laid(tmp_path, "given/other/meshes/A.stl", "given/my_arm/meshes/a.dae")
    with pytest.raises(RobotModelError, match="give --package-path the folder that holds the package my_arm") as caught:
        surface(tmp_path / "far", "package://my_arm/meshes/a.stl", (tmp_path / "given",))
    for part in (f"{tmp_path / 'given'}, ", "other/meshes/A.stl", "my_arm/meshes/a.dae"):
        assert part in str(caught.value)
    with pytest.raises(RobotModelError, match=r"The mesh a{300}\.stl was not found in"):
        surface(tmp_path / "far", f"{'a' * 300}.stl")
    laid(tmp_path, "ros/share/my_arm/meshes/a.stl")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    assert len(surface(tmp_path / "far", "package://my_arm/meshes/a.stl")[0].faces) == 1


def test_of_two_meshes_that_differ_none_is_taken_and_copies_are_one(tmp_path):
    laid(tmp_path, "given/a/my_arm/m.stl", "given/b/my_arm/m.stl")
    assert len(surface(tmp_path / "far", "package://my_arm/m.stl", (tmp_path / "given",))[1]) == 1
    (tmp_path / "given/b/my_arm/m.stl").write_text(ASCII_STL.replace("100", "90"))
    with pytest.raises(RobotModelError, match=r"Files of such a name: .*a/my_arm/m.stl"):
        surface(tmp_path / "far", "package://my_arm/m.stl", (tmp_path / "given",))


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.stl", b"", "is empty"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\n", "is a pointer of Git LFS: .* `git lfs pull`"),
        ("a.dae", b"\n<!DOCTYPE html><html>", "is a web page|extra 'meshes'"),
        ("a.obj", b"PK\3\4", "is a ZIP archive: unpack it"),
        ("a.stl", b"ISO-10303-21;\nHEADER;" * 9, "is neither text nor binary STL"),
        ("a.stl", ASCII_STL[:-12].encode(), "is cut, for it has no endsolid: give a complete file"),
        ("a.stl", BINARY[:-30], "is cut: it holds 1 of its 2 triangles: give a complete file"),
        ("a.stl", ASCII_STL.replace("0 50 0", "0 50,5 0").encode(), "a decimal comma in line 6, 'vertex 0 50,5 0'"),
        ("a.stl", ASCII_STL.replace("100 0", "1,0e2 0").replace("\n", "\r\n").encode(), "a decimal comma in line 5"),
        ("a.obj", OBJ.replace("50 0", "50,0 0").encode(), "a decimal comma in line 4"),
        ("a.stl", ASCII_STL.replace("0 50 0", "0 50 zero").encode(), "is damaged: .* could not be read to its end"),
        ("a.stl", ASCII_STL.replace("0 50 0", "0 50").encode(), "is damaged: incorrect number of vertices"),
        ("a.stl", ASCII_STL.replace("0 50 0", "50 0 0").encode(), "no triangle with an area"),
        ("a.stl", ASCII_STL.replace("100", "nan").encode(), "finite corners"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "is damaged: index 1 is out of bounds"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "is damaged: its faces do not count"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 9 9 9\n", "from 1 onwards: save it anew"),
        ("a.dae", b"<COLLADA", "is damaged|extra 'meshes'"),
        ("a.dae", b"<a>\n<float_array>0.1 0,2</float_array></a>", "a decimal comma in line 2|extra 'meshes'"),
        ("a.stl", BINARY[:80] + bytes(4) + BINARY[84:], "says that it has no triangle, but is longer"),
        ("a.passwd", b"root:x", "has an unknown format: use .stl, .obj, .dae"),
    ],
)
def test_a_broken_mesh_is_refused_in_one_sentence(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises((RobotModelError, MissingExtraError), match=sentence) as caught:
        read_mesh(tmp_path / name, [])
    assert re.search(re.escape(name), str(caught.value))
    assert "root:x" not in str(caught.value)


@pytest.mark.parametrize("rest", [b"", b"\0" * 37, b"made by hand", b"\0" * 50])
def test_a_binary_stl_is_read_whatever_its_header_and_what_follows(tmp_path, rest):
    (tmp_path / "a.stl").write_bytes(BINARY + rest)
    remarks = list[str]()
    assert read_mesh(tmp_path / "a.stl", remarks).triangles == pytest.approx(RECORD["c"])
    assert (
        remarks == [f"The {len(rest)} bytes after the last triangle of {tmp_path / 'a.stl'} are left out."][: len(rest)]
    )


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_text_stl_is_read_in_any_encoding(tmp_path, encoding):
    (tmp_path / "a.stl").write_bytes(ASCII_STL.upper().encode(encoding))
    assert len(read_mesh(tmp_path / "a.stl", []).faces) == 1
