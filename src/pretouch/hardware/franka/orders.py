"""What goes between the program and the process that moves the arm, in shared memory."""

import pickle
import struct
from enum import IntEnum

from pretouch.hardware.franka.report import CommunicationReport
from pretouch.hardware.franka.state import JOINTS, PACKED_MOST, FrankaState, packed, unpacked
from pretouch.hardware.mailbox import Mailbox
from pretouch.values import value

_ORDER = struct.Struct(f"<qqd{JOINTS}d")
_TOLD = struct.Struct("<dq?H")
_TEXT_MOST = 2000
REPORT_MOST = 4096


class Wish(IntEnum):
    """What the program wants of the arm."""

    WAIT = 0
    """Nothing."""
    MOVE = 1
    """A motion that follows the set-points."""
    END = 2
    """The motion brought to rest and ended."""
    RECOVER = 3
    """The arm out of the mode "reflex"."""
    QUIT = 4
    """The process ended, after the motion if there is one."""


@value
class Order:
    """What the program says; the newest counts."""

    request: int
    """Number of the wish: another number asks again."""
    wish: Wish
    stamp: float
    """Instant of the set-point, by `time.monotonic` [s]."""
    qd: list[float]
    """(7,) set-point [rad/s]."""


@value
class Told:
    """What the process says."""

    stamp: float
    """When the state came, by `time.monotonic` [s]."""
    answered: int
    """Number of the last request that was dealt with; a motion is when its first state came."""
    moving: bool
    """Whether a motion runs."""
    trouble: str
    """A sentence on what went wrong with that request, or ''."""
    state: FrankaState


class Boxes:
    """Mailboxes for both ways; as an argument of a process that is being spawned they are the same there."""

    def __init__(self) -> None:
        self._orders = Mailbox(_ORDER.size)
        self._told = Mailbox(_TOLD.size + _TEXT_MOST + PACKED_MOST)
        self._report = Mailbox(REPORT_MOST)
        self._number, self._order = 0, Order(0, Wish.WAIT, 0.0, [0.0] * JOINTS)

    def order(self, order: Order) -> None:
        """Give an order."""
        self._orders.write(_ORDER.pack(order.request, order.wish, order.stamp, *order.qd))

    def ordered(self) -> Order:
        """Return the newest order, the same object until there is another; before the first, to wait."""
        number, data = self._orders.read()
        if number != self._number:
            request, wish, stamp, *qd = _ORDER.unpack(data)
            self._number, self._order = number, Order(request, Wish(wish), stamp, qd)
        return self._order

    def tell(self, told: Told) -> None:
        """Give a state."""
        text = told.trouble.encode()[:_TEXT_MOST]
        head = _TOLD.pack(told.stamp, told.answered, told.moving, len(text))
        self._told.write(head + text + packed(told.state))

    def told(self) -> Told | None:
        """Return the newest state; None before the first."""
        number, data = self._told.read()
        if not number:
            return None
        stamp, answered, moving, length = _TOLD.unpack_from(data)
        start = _TOLD.size + length
        trouble = data[_TOLD.size : start].decode(errors="replace")
        return Told(stamp, answered, moving, trouble, unpacked(data[start:]))

    def put_report(self, report: CommunicationReport) -> None:
        """Give a report."""
        self._report.write(pickle.dumps(report))

    def report(self) -> CommunicationReport:
        """Return the newest report."""
        number, data = self._report.read()
        return pickle.loads(data) if number else CommunicationReport()  # noqa: S301  our own process wrote it
