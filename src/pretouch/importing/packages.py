"""Where the mesh files are that a URDF names."""

from pathlib import Path

from pretouch.errors import RobotModelError

_SCHEMES = ("package://", "model://")


class MeshFinder:
    """Finds mesh files: relative to the URDF, by absolute path, or in a ROS package.

    The package `p` of package://p/rest is looked for as the folder `p` in the folders given, in the folder of the
    file, and in each folder above it.
    """

    def __init__(self, file: Path, folders: tuple[Path, ...]) -> None:
        """Take the URDF, and folders that hold packages, or are packages themselves."""
        for folder in folders:
            if not folder.is_dir():
                raise RobotModelError(f"The package path {folder} is no folder: give one that holds ROS packages.")
        self._near = file.resolve().parent
        self._folders = [*folders, self._near, *self._near.parents]

    def find(self, uri: str) -> Path:
        """Return the file that a URI names; RobotModelError if there is none."""
        if "\0" in uri or len(uri) > 4000:
            raise RobotModelError(f"The mesh name {uri[:100]!r} is no file name: correct it.")
        scheme = next((s for s in _SCHEMES if uri.startswith(s)), None)
        try:
            found = self._in_package(uri.removeprefix(scheme)) if scheme else self._plain(uri)
        except OSError:  # a name too long, for one
            found = None
        if found is None:
            way_out = (
                f"give --package-path the folder that holds the package {uri.removeprefix(scheme).split('/')[0]}"
                if scheme
                else "put it where the URDF says"
            )
            raise RobotModelError(f"The mesh {uri} is not there: {way_out}.")
        return found

    def _plain(self, uri: str) -> Path | None:
        path = self._near / uri.removeprefix("file://")
        return path if path.is_file() else None

    def _in_package(self, name: str) -> Path | None:
        package, _, rest = name.partition("/")
        for folder in self._folders:
            for path in (folder / package / rest, folder / rest if folder.name == package else None):
                if path is not None and path.is_file():
                    return path
        return None
