"""What can be said after `pretouch robot`: one dataclass a command, its docstrings are the help."""

from dataclasses import dataclass
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Import:
    """Read your own arm from a URDF or MJCF file: fit capsules to its links, and write a description of it.

    Look at what is printed: all that the file does not say is assumed, with a sentence for each.
    """

    file: tyro.conf.Positional[str]
    """URDF file (not a xacro template) or MJCF file, or a name of the package robot_descriptions, if it is installed,
    such as ur5e_mj_description."""
    out: str = ""
    """Folder to write robot.toml and arm.xml to; by default the arm's name."""
    ee: str = ""
    """Link whose origin is the end-effector; by default the most likely one."""
    name: str = ""
    """Name of the arm; by default the file's."""
    package_path: str = ""
    """Folders that hold the ROS packages of package:// paths, separated by commas; those above the file are
    searched in any case."""
    qd_max: str = ""
    """Joint velocity limits [rad/s], one for all or one per joint, separated by commas; by default the file's."""
    qdd_max: str = ""
    """Joint acceleration limits [rad/s^2]; no file has them."""
    tau_max: str = ""
    """Joint torque limits [Nm]; by default the file's."""
    ready: str = ""
    """Usual start posture [rad], one position per joint, separated by commas; by default one is searched for."""
    capsules: int = 3
    """Largest number of capsules per link."""
    cover: bool = False
    """Enlarge the capsules until no surface sticks out of them: the arm then keeps more distance than necessary."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> None:
        """Import the arm."""
        from pretouch.cli.robot_import import import_arm

        import_arm(self)


@dataclass(frozen=True)
class Check:
    """Check an arm's folder after a change by hand, and report what is wrong with it."""

    folder: tyro.conf.Positional[str]
    """Folder of the arm, or its robot.toml."""
    skin: str = ""
    """Skin file; by default the folder's own."""
    json: str = ""
    """File for the numbers, or - for standard output: text then goes to standard error."""

    def run(self) -> None:
        """Check the arm."""
        from pretouch.cli.robot_check import check_arm

        check_arm(self)


@dataclass(frozen=True)
class Robot:
    """Your own arms: import one from its URDF or MJCF file, or check one that was changed by hand."""

    what: Annotated[Import, tyro.conf.subcommand("import")] | Annotated[Check, tyro.conf.subcommand("check")]

    def run(self) -> None:
        """Run the command."""
        self.what.run()
