"""Robots by the names that the package robot_descriptions of PyPI gives them: it fetches their files by git."""

import re
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from pretouch.errors import RobotModelError

_PACKAGE = "robot_descriptions"
_NAME = re.compile(r"[a-z][a-z0-9_]*_description")


def is_description(name: str) -> bool:
    """Whether a name is no file's or folder's, but like those of the package robot_descriptions, as ur5_description."""
    return _NAME.fullmatch(name) is not None and not Path(name).exists()


def described(name: str) -> tuple[Path, Path]:
    """Return the URDF or MJCF file of a robot by its name, and the folder that holds its ROS package.

    The package is not required: where it is not installed, does not know the name, or cannot fetch the files, a
    RobotModelError says so.
    """
    if find_spec(_PACKAGE) is None:
        raise RobotModelError(
            f"There is no file {name}, and by this name only the package {_PACKAGE} could bring one, which is not"
            f" installed: run pip install {_PACKAGE}, or give a URDF or MJCF file."
        )
    module = f"{_PACKAGE}.{name}"
    if find_spec(module) is None:
        known = getattr(import_module(_PACKAGE), "DESCRIPTIONS", {})
        near = ", ".join(get_close_matches(name, known)) or "the names in its documentation"
        raise RobotModelError(f"The package {_PACKAGE} has no {name}: choose from {near}, or give a file.")
    try:
        found = import_module(module)
        file = getattr(found, "URDF_PATH", None) or getattr(found, "MJCF_PATH", None)
        package = Path(getattr(found, "PACKAGE_PATH", None) or Path(str(file)).parent)
    except Exception as error:  # whatever git, its cache or a macro processor have to say
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise RobotModelError(
            f"The package {_PACKAGE} could not bring {name}: {reason}. It fetches each robot once, by git from the"
            " Internet: get that to work, or give a URDF or MJCF file."
        ) from error
    if not file:
        raise RobotModelError(f"{module} names neither a URDF nor an MJCF file: give a file in place of {name}.")
    return Path(file), package.parent
