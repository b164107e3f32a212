"""A coloured mesh as binary glTF, the one format in which the page takes a colour for each vertex.

Positions are quantised to 16 bits (KHR_mesh_quantization), and normals are left to the page, which computes them. All
but the colours is packed once.
"""

import json
import struct

import numpy as np

from pretouch.errors import ViewerError
from pretouch.types import FloatArray
from pretouch.viewer import palette
from pretouch.viewer.surface import Mesh

_MAGIC, _JSON, _BINARY = b"glTF", 0x4E4F534A, 0x004E4942
_BYTE, _SHORT, _USHORT, _UINT = 5121, 5122, 5123, 5125
_MOST = 32767


class ColouredMesh:
    """A mesh whose colours change: `painted(colours)` is its GLB file."""

    def __init__(self, mesh: Mesh) -> None:
        if not len(mesh.faces):
            raise ViewerError("A mesh without faces cannot be drawn: give the link a body.")
        middle = (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2
        size = float(np.abs(mesh.vertices - middle).max()) or 1.0
        fits = len(mesh.vertices) <= 0xFFFF
        places = np.zeros((len(mesh.vertices), 4), dtype="<i2")  # rows of a multiple of four bytes
        places[:, :3] = np.rint((mesh.vertices - middle) / size * _MOST)
        indices = mesh.faces.astype("<u2" if fits else "<u4").tobytes()
        self._count = len(mesh.vertices)
        self._before = places.tobytes() + indices + b"\0" * (-len(indices) % 4)
        described = _described(self._count, mesh.faces.size, len(indices), fits, middle, size, places[:, :3])
        text = json.dumps(described, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        length = len(self._before) + 4 * self._count
        self._head = struct.pack("<4sII", _MAGIC, 2, 12 + 8 + len(text) + 8 + length)
        self._head += struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", length, _BINARY)

    def painted(self, colours: FloatArray) -> bytes:
        """Return the GLB file with colours (V, 3) from 0 to 255, as a screen shows them."""
        rgba = np.full((self._count, 4), 255, dtype=np.uint8)
        rgba[:, :3] = palette.as_vertex(np.clip(colours, 0, 255))
        return self._head + self._before + rgba.tobytes()


def _described(
    vertices: int, corners: int, index_bytes: int, short: bool, middle: FloatArray, size: float, places: FloatArray
) -> dict[str, object]:
    """The glTF document for positions, then indices, then colours in one buffer."""
    at_index, at_colour = 8 * vertices, 8 * vertices + index_bytes + -index_bytes % 4
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": middle.tolist(), "scale": [size] * 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 2}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}}],
        "buffers": [{"byteLength": at_colour + 4 * vertices}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 8 * vertices, "byteStride": 8, "target": 34962},
            {"buffer": 0, "byteOffset": at_index, "byteLength": index_bytes, "target": 34963},
            {"buffer": 0, "byteOffset": at_colour, "byteLength": 4 * vertices, "byteStride": 4, "target": 34962},
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": _SHORT, "normalized": True, "count": vertices, "type": "VEC3",
                "min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": _USHORT if short else _UINT, "count": corners, "type": "SCALAR"},
            {"bufferView": 2, "componentType": _BYTE, "normalized": True, "count": vertices, "type": "VEC4"},
        ],
    }  # fmt: skip
