"""A serial line over USB, by the standard library alone."""

import errno
import fcntl
import os
import select
import struct
import termios
import time
import tty
from contextlib import suppress
from glob import glob
from pathlib import Path
from typing import Self

from pretouch.errors import HardwareError

_PATTERNS = ("/dev/ttyUSB*", "/dev/ttyACM*", "/dev/tty.usb*", "/dev/tty.wchusb*")
_BLOCK = 4096
_RESET_S = 0.05
_OUTPUT_SPEED = 5
_INPUT_SPEED = 4


class SerialLine:
    """A serial device at 115200 baud, eight bits, no parity, without echo; a context manager.

    One that is not there, is none, may not be opened or is in use is a HardwareError.
    """

    def __init__(self, device: Path) -> None:
        self._device = Path(device)
        try:
            self._handle = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            raise HardwareError(_not_opened(self._device, error)) from error
        try:
            self._before = termios.tcgetattr(self._handle)
            fcntl.ioctl(self._handle, termios.TIOCEXCL)
            tty.setraw(self._handle)
            settings = termios.tcgetattr(self._handle)
            settings[_INPUT_SPEED] = settings[_OUTPUT_SPEED] = termios.B115200
            termios.tcsetattr(self._handle, termios.TCSANOW, settings)
        except (termios.error, OSError) as error:
            os.close(self._handle)
            raise HardwareError(
                f"{self._device} is not a serial line: give the unit's device{_there_are(', one of ')}."
            ) from error

    def reset(self) -> None:
        """Begin the unit anew by the control lines, as the usual boards have them wired; others do not mind.

        RTS alone pulls the reset line; DTR alone would ask for the boot loader.
        """
        with suppress(OSError):  # a line without control lines
            for request, line in (
                (termios.TIOCMBIC, termios.TIOCM_DTR),
                (termios.TIOCMBIS, termios.TIOCM_RTS),
                (termios.TIOCMBIC, termios.TIOCM_RTS),
            ):
                fcntl.ioctl(self._handle, request, struct.pack("i", line))
                time.sleep(_RESET_S)

    def write(self, data: bytes, timeout: float) -> None:
        """Send bytes; a line that does not take them within a time [s] is a HardwareError."""
        until, left = time.monotonic() + timeout, memoryview(data)
        while left:
            if not select.select([], [self._handle], [], max(0.0, until - time.monotonic()))[1]:
                raise HardwareError(
                    f"{self._device} accepted no data for {timeout:g} s: unplug the unit and plug it in again."
                )
            try:
                left = left[os.write(self._handle, left) :]
            except OSError as error:
                raise self._gone(error) from error

    def read(self, timeout: float) -> bytes:
        """Return what has come, b'' if nothing comes within a time [s]."""
        if not select.select([self._handle], [], [], max(0.0, timeout))[0]:
            return b""
        try:
            data = os.read(self._handle, _BLOCK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(error) from error
        if not data:
            raise self._gone(None)
        return data

    def close(self) -> None:
        """Leave the line as it was found."""
        with suppress(termios.error, OSError):  # a device that went away has no settings to give back
            fcntl.ioctl(self._handle, termios.TIOCNXCL)
            termios.tcsetattr(self._handle, termios.TCSANOW, self._before)
        os.close(self._handle)

    def _gone(self, error: OSError | None) -> HardwareError:
        why = f" ({error.strerror})" if error else ""
        return HardwareError(
            f"{self._device} disappeared{why}: if the unit's chip has its own USB, start the command within 3 s after a"
            " reset; otherwise plug it in again with a good cable."
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _not_opened(device: Path, error: OSError) -> str:
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.ENOTDIR):
        return (
            f"There is no device {device}: plug the unit in with a cable that carries data"
            f"{_there_are(', or give one of ')}."
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return (
            f"You have no permission to open {device}: join its group with `sudo usermod -aG dialout $USER`, and log in"
            " again."
        )
    if error.errno == errno.EBUSY:
        return f"{device} is in use by another program: end it (a serial monitor or flasher)."
    return f"{device} cannot be opened: {error.strerror}: give the unit's serial device{_there_are(', one of ')}."


def _there_are(words: str) -> str:
    found = sorted(place for pattern in _PATTERNS for place in glob(pattern))
    return words + ", ".join(found) if found else ""
