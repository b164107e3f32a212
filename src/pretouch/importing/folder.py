"""The folder an arm is kept in: robot.toml and arm.xml."""

import shutil
from dataclasses import replace
from pathlib import Path

from pretouch.errors import RobotModelError
from pretouch.importing.robot_import import MJCF, Imported
from pretouch.robot.description import FILE, description_text


def write_folder(found: Imported, folder: Path) -> None:
    """Write an arm's folder, whole or not at all; one that is there is a RobotModelError."""
    check_free(folder)
    try:
        folder.mkdir(parents=True)
        try:
            _fill(found, folder)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
    except OSError as error:
        raise RobotModelError(
            f"The folder {folder} cannot be written: {error.strerror}: give another --out."
        ) from error


def check_free(folder: Path) -> None:
    """Raise RobotModelError if a folder is there."""
    if folder.exists() or folder.is_symlink():
        raise RobotModelError(f"The folder {folder} exists already: give another --out, or remove it.")


def _fill(found: Imported, folder: Path) -> None:
    (folder / MJCF).write_text(found.mjcf_text, encoding="utf-8")
    description = replace(found.description, mjcf=folder / MJCF)
    (folder / FILE).write_text(description_text(description), encoding="utf-8")
