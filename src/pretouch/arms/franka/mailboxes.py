"""Commands from the program to the process that moves the arm, and feedback from it, in shared memory."""

import pickle
import struct
from enum import IntEnum

from pretouch.arms.franka.report import CommunicationReport
from pretouch.arms.franka.state import JOINTS, PACKED_MOST, FrankaState, packed, unpacked
from pretouch.units.shared_memory import Mailbox
from pretouch.values import value

_COMMAND = struct.Struct(f"<qqd{JOINTS}d")
_FEEDBACK = struct.Struct("<dq?H")
_TEXT_MOST = 2000
REPORT_MOST = 4096


class Request(IntEnum):
    """What the program asks of the arm."""

    WAIT = 0
    """Nothing."""
    MOVE = 1
    """Follow the set-points."""
    END = 2
    """Come to rest and end the motion."""
    RECOVER = 3
    """Leave the mode "reflex"."""
    QUIT = 4
    """End the motion, if there is one, and then the process."""


@value
class Command:
    """What the program sends; the newest one counts."""

    number: int
    """Number of the request; a new number asks again."""
    request: Request
    stamp: float
    """Instant of the set-point, by `time.monotonic` [s]."""
    qd: list[float]
    """(7,) set-point [rad/s]."""


@value
class Feedback:
    """What the process reports."""

    stamp: float
    """When the state arrived, by `time.monotonic` [s]."""
    answered: int
    """Number of the last request that was carried out; a motion counts from its first state on."""
    moving: bool
    """Whether a motion is running."""
    trouble: str
    """A sentence on what went wrong with that request, or ''."""
    state: FrankaState


class Mailboxes:
    """Mailboxes in both directions. Passed to a spawned process, they are the same mailboxes there."""

    def __init__(self) -> None:
        self._commands = Mailbox(_COMMAND.size)
        self._feedback = Mailbox(_FEEDBACK.size + _TEXT_MOST + PACKED_MOST)
        self._report = Mailbox(REPORT_MOST)
        self._number, self._command = 0, Command(0, Request.WAIT, 0.0, [0.0] * JOINTS)

    def send_command(self, command: Command) -> None:
        """Make a command the newest one."""
        self._commands.write(_COMMAND.pack(command.number, command.request, command.stamp, *command.qd))

    def newest_command(self) -> Command:
        """Return the newest command: the same object until there is another one; WAIT before the first."""
        number, data = self._commands.read()
        if number != self._number:
            request_number, request, stamp, *qd = _COMMAND.unpack(data)
            self._number, self._command = number, Command(request_number, Request(request), stamp, qd)
        return self._command

    def send_feedback(self, feedback: Feedback) -> None:
        """Make a state the newest one."""
        text = feedback.trouble.encode()[:_TEXT_MOST]
        head = _FEEDBACK.pack(feedback.stamp, feedback.answered, feedback.moving, len(text))
        self._feedback.write(head + text + packed(feedback.state))

    def newest_feedback(self) -> Feedback | None:
        """Return the newest state; None before the first."""
        number, data = self._feedback.read()
        if not number:
            return None
        stamp, answered, moving, length = _FEEDBACK.unpack_from(data)
        start = _FEEDBACK.size + length
        trouble = data[_FEEDBACK.size : start].decode(errors="replace")
        return Feedback(stamp, answered, moving, trouble, unpacked(data[start:]))

    def put_report(self, report: CommunicationReport) -> None:
        """Make a report the newest one."""
        self._report.write(pickle.dumps(report))

    def report(self) -> CommunicationReport:
        """Return the newest report."""
        number, data = self._report.read()
        return pickle.loads(data) if number else CommunicationReport()  # noqa: S301  our own process wrote it
