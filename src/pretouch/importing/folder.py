"""The folder an arm is kept in: robot.toml, arm.xml and skin.toml."""

import os
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from pretouch.errors import RobotModelError
from pretouch.importing.robot_import import MJCF, Imported
from pretouch.robot.description_file import FILE, description_text
from pretouch.sensing.skin import OWN_SKIN, save_skin


def write_folder(found: Imported, folder: Path, force: bool = False) -> Path | None:
    """Write an arm's folder, whole or not at all; one that is there is a RobotModelError unless `force` says so.

    Nothing is lost: a folder that is replaced is kept under another name, which is returned.
    """
    check_free(folder, force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix=".robot-", dir=folder.parent))
        try:
            _fill(found, unfinished)
            aside = _put_aside(folder)
            try:
                os.rename(unfinished, folder)
            except BaseException:
                if aside is not None:
                    os.rename(aside, folder)
                raise
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise
    except OSError as error:
        raise RobotModelError(
            f"The folder {folder} cannot be written: {error.strerror}: give another --out."
        ) from error
    return aside


def check_free(folder: Path, force: bool = False) -> None:
    """Raise RobotModelError if a folder is there, unless it may be put aside."""
    if (folder.exists() or folder.is_symlink()) and not force:
        raise RobotModelError(f"The folder {folder} exists already: give another --out, or --force to rename it.")


def _fill(found: Imported, folder: Path) -> None:
    (folder / MJCF).write_text(found.mjcf_text, encoding="utf-8")
    description = replace(found.description, mjcf=folder / MJCF)
    (folder / FILE).write_text(description_text(description), encoding="utf-8")
    if len(found.skin):
        save_skin(found.skin, folder / OWN_SKIN)
    os.chmod(folder, 0o755)  # noqa: S103  a folder as any other


def _put_aside(folder: Path) -> Path | None:
    if not (folder.exists() or folder.is_symlink()):
        return None
    k = 1
    while (aside := folder.with_name(f"{folder.name}.old-{k}")).exists():
        k += 1
    os.rename(folder, aside)
    return aside
