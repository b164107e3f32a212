import io
import json
import struct

import numpy as np
import pytest
import trimesh

from pretouch.errors import ViewerError
from pretouch.robot.model import RobotModel
from pretouch.viewer.arm import capsule_surfaces
from pretouch.viewer.glb import ColouredMesh
from pretouch.viewer.surface import Mesh


def read(data: bytes) -> tuple[dict, bytes]:  # type: ignore[type-arg]
    magic, version, length, text_length, kind = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), 0x4E4F534A)
    binary_length, binary_kind = struct.unpack_from("<II", data, 20 + text_length)
    assert binary_kind == 0x004E4942
    assert text_length % 4 == binary_length % 4 == 0
    return json.loads(data[20 : 20 + text_length]), data[28 + text_length :][:binary_length]


def test_a_file_holds_the_mesh_to_a_hundredth_of_a_millimetre_and_its_colours(panda_model: RobotModel) -> None:
    mesh = capsule_surfaces(panda_model)[5]
    colours = np.random.default_rng(0).uniform(0, 255, mesh.vertices.shape)
    document, binary = read(ColouredMesh(mesh).painted(colours))
    views, node, count = document["bufferViews"], document["nodes"][0], len(mesh.vertices)

    places = np.frombuffer(binary, "<i2", 4 * count, views[0]["byteOffset"]).reshape(-1, 4)[:, :3] / 32767
    np.testing.assert_allclose(places * node["scale"] + node["translation"], mesh.vertices, atol=1e-5)
    faces = np.frombuffer(binary, "<u2", mesh.faces.size, views[1]["byteOffset"]).reshape(-1, 3)
    np.testing.assert_array_equal(faces, mesh.faces)
    rgba = np.frombuffer(binary, "u1", 4 * count, views[2]["byteOffset"]).reshape(-1, 4)
    linear = rgba[:, :3] / 255
    screen = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(255 * screen - colours)[colours > 60].max() < 3  # steps of light are coarse in the dark
    assert (rgba[:, 3] == 255).all()


def test_another_program_reads_the_file(panda_model: RobotModel) -> None:
    mesh = capsule_surfaces(panda_model)[6]
    data = ColouredMesh(mesh).painted(np.full(mesh.vertices.shape, 128.0))
    read_back = trimesh.load(io.BytesIO(data), file_type="glb", process=False).to_mesh()
    assert len(read_back.faces) == len(mesh.faces)


def test_a_mesh_without_a_face_is_refused() -> None:
    with pytest.raises(ViewerError, match="give the link a body"):
        ColouredMesh(Mesh(np.zeros((1, 3)), np.zeros((0, 3), np.int64), np.zeros((1, 3))))


def test_a_large_mesh_gets_wide_indices() -> None:
    count = 70_000
    vertices = np.random.default_rng(0).uniform(size=(count, 3))
    faces = np.arange(count - 1).reshape(-1, 3)
    document, binary = read(ColouredMesh(Mesh(vertices, faces, vertices)).painted(vertices))
    assert document["accessors"][1]["componentType"] == 5125
    found = np.frombuffer(binary, "<u4", faces.size, document["bufferViews"][1]["byteOffset"])
    np.testing.assert_array_equal(found, faces.ravel())
