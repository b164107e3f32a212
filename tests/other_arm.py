"""An arm that does not come with the package, without an import: a copy of the Panda's files."""

from pathlib import Path

from pretouch.robot.description import description_text, panda
from pretouch.sensing.skin import OWN_SKIN, PAPER_SKIN


def copied_panda(folder: Path) -> Path:
    """Write the folder of an arm that is a Panda, with the paper's skin, and is not known to be one."""
    (folder / "robot.toml").write_text(description_text(panda()))
    (folder / panda().mjcf.name).write_bytes(panda().mjcf.read_bytes())
    (folder / OWN_SKIN).write_bytes(PAPER_SKIN.read_bytes())
    return folder
