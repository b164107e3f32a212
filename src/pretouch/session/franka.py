"""A Franka arm as a session's, and by what its confirmed force sign is remembered."""

from importlib.metadata import version

from pretouch.errors import RobotError
from pretouch.hardware.franka.arm import FrankaArm
from pretouch.hardware.franka.client import LIBRARIES, Kind
from pretouch.hardware.franka.errors import check_ready
from pretouch.session.confirmations import Identity
from pretouch.types import FloatArray, RobotState

_NAMES: dict[Kind, str] = {"panda": "Panda", "fr3": "FR3"}
_REFLEX = "reflex"


def identity(kind: Kind, address: str) -> Identity:
    """Return what a robot at an address is known by: another library asks for the guided pushes again."""
    library = LIBRARIES[kind].distribution
    return Identity(kind, address, f"{library} {version(library)}")


class FrankaSessionArm:
    """The port `Arm` over the process that speaks with a Franka arm."""

    def __init__(self, arm: FrankaArm, kind: Kind, address: str) -> None:
        """Take an arm that is connected."""
        self._arm, self._address = arm, address
        self.name = f"{_NAMES[kind]} at {address}"

    def read(self) -> RobotState:
        """Return the newest state."""
        return self._arm.read()

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (7,) [rad/s] as the set-point."""
        self._arm.command(qd)

    def unfit(self) -> tuple[str, ...]:
        """Say why the arm is in no mode to be moved."""
        state = self._arm.state()
        try:
            check_ready(state, self._address)
        except RobotError as error:
            return (str(error), "Run with --recover.") if state.mode == _REFLEX else (str(error),)
        return ()

    @property
    def reflex(self) -> bool:
        """Whether the arm has stopped by itself and must recover."""
        return self._arm.state().mode == _REFLEX

    def recover(self) -> None:
        """Let the arm recover; what forbids it is a RobotError."""
        self._arm.recover()

    def begin(self) -> None:
        """Begin a motion at rest."""
        self._arm.begin()

    def end(self) -> None:
        """Come to rest and end the motion."""
        self._arm.end()

    def report(self) -> str:
        """Say how well the line to the arm did; '' if no motion has ended."""
        report = self._arm.report
        return str(report) if report.cycles else ""
