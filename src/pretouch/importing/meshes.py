"""Mesh files that a URDF names: where they are, and what is wrong with them."""

import os
import re
import warnings
from collections import defaultdict
from contextlib import suppress
from functools import cached_property
from io import BytesIO
from itertools import islice
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import numpy as np
from trimesh import Trimesh, load_scene

from pretouch.errors import RobotModelError
from pretouch.extras import MESHES

_SUFFIXES = (".stl", ".obj", ".dae")
_MOST_FOLDERS = 20_000
"""Folders that are searched for a mesh which is not where the file says."""
_ROS = (("AMENT_PREFIX_PATH", "share"), ("ROS_PACKAGE_PATH", ""))
"""Variables with the folders of ROS, and the folder of packages in each."""
_OTHER = {
    b"": "is empty",
    b"version https://git-lfs": "is a pointer of Git LFS: get the file itself by `git lfs pull`",
    b"<!doctype html": "is a web page: download the file itself",
    b"pk\x03\x04": "is a ZIP archive: unpack it",
    b"\x1f\x8b": "is compressed: unpack it by gunzip",
}
"""Beginnings of files that people take for meshes."""
_COMMA = re.compile(rb"^[ \t]*v(?:ertex)?[ \t][^\n]*\d,\d[^\n]*|<float_array[^>]*>[^<]*?\d,\d", re.M | re.I)


class MeshFiles:
    """Meshes by the names that a URDF has for them.

    A mesh is where its name says: relative to the URDF, by absolute path, or in a ROS package. The package `p` is the
    folder `p` in one of some folders, or one of them; or in the URDF's folder or one above it. Where nothing is there,
    a file below these folders, or in the URDF's own package, is taken if it alone has the same name and folders, in
    whatever case. Of a path of another machine only the last three parts count, or those after share/.
    """

    def __init__(self, urdf: Path, folders: tuple[Path, ...], remarks: list[str]) -> None:
        self._near, self._folders, self._remarks = urdf.resolve().parent, folders, remarks

    def read(self, uri: str, scale: np.ndarray) -> Trimesh:
        """Return the surface of a mesh, scaled; a RobotModelError says where it was looked for, or what is wrong."""
        return read_mesh(self.find(uri), self._remarks).apply_scale(scale)

    def find(self, uri: str) -> Path:
        """Return the file of a mesh, and note if it is elsewhere than its name says."""
        scheme, _, name = unquote(uri).replace("\\", "/").rpartition("://")
        scheme = scheme.lower()
        near, package = self._near, ""
        places = [near / (name.removeprefix("localhost") if scheme == "file" else name)]
        parts = [part.lower() for part in places[0].parts if part != ".."]
        count = len([part for part in Path(name).parts if part != ".."])
        if scheme in ("package", "model"):
            name = name.lstrip("/")
            package, _, rest = name.partition("/")
            ros = [Path(p) / below for name, below in _ROS for p in os.environ.get(name, "").split(":") if p]
            around = [*self._folders, near, *near.parents, *ros]
            places = [folder / name for folder in around] + [f / rest for f in around if f.name == package]
            count = len(Path(name).parts)
        elif Path(name).is_absolute() or name[1:3] == ":/":
            count = parts[::-1].index("share") if "share" in parts else 3
        for place in places:
            with suppress(OSError, ValueError):  # a name may be too long, or none
                if place.is_file():
                    return place
        like = {place: other for other, place in self._below.get(Path(name).stem.lower(), [])}
        best = [place for place, other in like.items() if other[-count:] == parts[-count:]]
        if len(best) == 1 or len({place.read_bytes() for place in best}) == 1:  # a workspace has copies
            remark = f"Meshes are not where the file says: those of the same names in {best[0].parent} are taken."
            self._remarks += [] if remark in self._remarks else [remark]
            return best[0]
        looked = ", ".join(map(str, [places[0].parent, *self._roots]))
        files = f" Files of such a name: {', '.join(map(str, like))}." if like else ""
        way_out = f"the package {package}" if package else f"{places[0].name}, or correct its name in the file"
        raise RobotModelError(
            f"The mesh {uri} was not found in {looked} and below: give --package-path the folder that holds {way_out}."
            f"{files}"
        )

    @cached_property
    def _roots(self) -> list[Path]:
        """Folders to search: those that were named, and the URDF's package."""
        package = next((f for f in (self._near, *self._near.parents) if (f / "package.xml").is_file()), self._near)
        return [*(folder.resolve() for folder in self._folders), package]

    @cached_property
    def _below(self) -> dict[str, list[tuple[list[str], Path]]]:
        """Meshes below the roots by their names without ending, with the parts of their paths, all in small letters.

        The folder of a package has the package's own name there: a clone may have another.
        """
        meshes = defaultdict[str, list[tuple[list[str], Path]]](list)
        for root in dict.fromkeys(self._roots):
            names = {root.parent: [part.lower() for part in root.parent.parts]}
            for folder, below, files in islice(os.walk(root), _MOST_FOLDERS):
                here = Path(folder)
                below[:] = sorted(name for name in below if not name.startswith("."))
                names[here] = [*names[here.parent], _package_name(here, files).lower()]
                for file in files:
                    if (here / file).suffix.lower() in _SUFFIXES:
                        meshes[Path(file).stem.lower()].append(([*names[here], file.lower()], here / file))
        return meshes


def _package_name(folder: Path, files: list[str]) -> str:
    """Return the name of a folder, or of the ROS package that it is."""
    if "package.xml" in files:
        with suppress(OSError, ET.ParseError):
            return (ET.parse(folder / "package.xml").findtext("name") or "").strip() or folder.name  # noqa: S314
    return folder.name


def read_mesh(path: Path, remarks: list[str]) -> Trimesh:
    """Read a mesh file, as its suffix says, in metres. What is wrong with it is a RobotModelError that names it.

    Nothing but the file itself is read: no materials or textures beside it. What is left out of it is a remark.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise RobotModelError(f"The mesh {path} has an unknown format: use {', '.join(_SUFFIXES)}.")
    if suffix == ".dae":
        MESHES.need(f"The mesh {path}, a COLLADA file,")
    try:
        data = path.read_bytes()
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            data = data.decode("utf-16").encode()
        _check_kind(data)
        if suffix == ".stl":
            data = _whole_stl(data, path, remarks)
        elif suffix == ".obj":
            _check_obj(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read")  # NumPy would leave the rest out
            scene = load_scene(BytesIO(data), suffix[1:], process=False)
            mesh = (scene.convert_units("meters") if scene.units else scene).to_mesh()
    except RobotModelError as error:
        raise RobotModelError(f"The mesh {path} {error}.") from error
    except Exception as error:  # whatever a library makes of a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotModelError(f"The mesh {path} is damaged: {reason}.") from error
    if not len(mesh.faces) or not np.isfinite(mesh.triangles).all() or not np.any(mesh.triangles_cross):
        raise RobotModelError(
            f"The mesh {path} holds no triangle with an area and finite corners: save it anew by another program."
        )
    return mesh


def _check_kind(data: bytes) -> None:
    """Refuse what is no mesh, and text with decimal commas, which readers cut off."""
    for beginning, sentence in _OTHER.items():
        if data.lstrip().lower().startswith(beginning) if beginning else not data:
            raise RobotModelError(sentence)
    if b"\0" not in data and (comma := _COMMA.search(data)):
        number, line = data.count(b"\n", 0, comma.end()) + 1, comma[0].decode(errors="replace").strip()[-60:]
        raise RobotModelError(f"has a decimal comma in line {number}, {line!r}: save it with decimal points")


def _whole_stl(data: bytes, path: Path, remarks: list[str]) -> bytes:
    """Return an STL file without what follows its last triangle; refuse one that is cut."""
    count = int.from_bytes(data[80:84], "little")
    end = 84 + 50 * count
    text = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1024].lower()
    if len(data) != end and text.startswith(b"solid") and b"facet" in text:
        if b"endsolid" not in data[-4096:].lower():
            raise RobotModelError("is cut, for it has no endsolid: give a complete file")
        return data
    if b"\0" not in data:
        raise RobotModelError("is neither text nor binary STL: save it anew as STL")
    if len(data) < end:
        whole = max(0, len(data) - 84) // 50
        raise RobotModelError(f"is cut: it holds {whole} of its {count} triangles: give a complete file")
    if count == 0 and len(data) > end + 50:
        raise RobotModelError("says that it has no triangle, but is longer than that: save it anew by another program")
    if len(data) > end:
        remarks.append(f"The {len(data) - end} bytes after the last triangle of {path} are left out.")
    return data[:end]


def _check_obj(data: bytes) -> None:
    """Refuse corners counted backwards or from 0: trimesh 5.2 takes them for other ones."""
    faces = (line.split()[1:] for line in data.splitlines() if line.startswith(b"f "))
    if any(int(corner.split(b"/")[0]) < 1 for face in faces for corner in face):
        raise RobotModelError(
            "is damaged: its faces do not count their corners from 1 onwards: save it anew by another program"
        )
