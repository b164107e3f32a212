"""A UDP socket that withstands a flood: a long queue, and a kernel filter where there is one."""

import ctypes
import errno
import socket
import struct
import sys

from pretouch.errors import HardwareError
from pretouch.hardware.wire import HELLO_SIZE, MAGIC, SAMPLE_LEAST, SAMPLE_MOST, VERSION, Kind

_SO_RCVBUFFORCE, _SO_ATTACH_FILTER = 33, 26
"""Of Linux."""


def demand_port(host: str, port: int) -> None:
    """Raise a HardwareError for what is no port."""
    if type(port) is not int or not 0 <= port <= 0xFFFF:
        raise HardwareError(
            f"The port {port!r} for {host} is not valid: choose one from 1 to 65535, or 0 for any free port."
        )


def bind(host: str, port: int, buffer_bytes: int) -> socket.socket:
    """Open a socket that never blocks, at this address; one that cannot be had is a HardwareError."""
    demand_port(host, port)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        opened = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise HardwareError(f"The address {host}, port {port}, cannot be listened on: {error}.") from None
    try:
        opened.setblocking(False)
        _widen(opened, buffer_bytes)
        opened.bind(address)
    except OSError as error:
        opened.close()
        if error.errno == errno.EADDRINUSE:
            raise HardwareError(
                f"Port {port} of {host} is in use: end the program that listens there, or choose another port."
            ) from None
        raise HardwareError(f"Listening on {host}, port {port}, failed: {error.strerror}.") from None
    return opened


def _widen(opened: socket.socket, buffer_bytes: int) -> None:
    """Ask for a long queue: past the system's limit if that is allowed."""
    if sys.platform == "linux":
        try:
            opened.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, buffer_bytes)
        except PermissionError:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
    else:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)


def attach_filter(opened: socket.socket, sample_most: int = SAMPLE_MOST) -> bool:
    """Let the kernel drop what has not size, magic, version and kind of hello or sample; return whether it does.

    Samples are of `sample_most` bytes at most.
    """
    if sys.platform != "linux":
        return False
    program = _program(sample_most)
    code = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: number of instructions, pointer to them
    wanted = struct.pack("HP", len(program) // _INSTRUCTION.size, ctypes.addressof(code))
    try:
        opened.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, wanted)
    except OSError:
        return False
    return True


_INSTRUCTION = struct.Struct("HBBI")
"""Of classic BPF: code, steps if true, steps if false, constant."""
_LENGTH, _WORD, _EQUAL, _AT_LEAST, _ABOVE, _RETURN = 0x80, 0x20, 0x15, 0x35, 0x25, 0x06
_UDP_HEADER = 8
"""What the filter sees in front of the datagram [B]."""


def _program(sample_most: int) -> bytes:
    start = [int.from_bytes(MAGIC + bytes([VERSION, kind]), "big") for kind in (Kind.SAMPLE, Kind.HELLO)]
    steps = [
        (_WORD, 0, 0, _UDP_HEADER),
        (_EQUAL, 3, 0, start[0]),
        (_EQUAL, 0, 5, start[1]),
        (_LENGTH, 0, 0, 0),
        (_EQUAL, 4, 3, HELLO_SIZE + _UDP_HEADER),
        (_LENGTH, 0, 0, 0),
        (_AT_LEAST, 0, 1, SAMPLE_LEAST + _UDP_HEADER),
        (_ABOVE, 0, 1, sample_most + _UDP_HEADER),
        (_RETURN, 0, 0, 0),
        (_RETURN, 0, 0, 0xFFFF),
    ]
    return b"".join(_INSTRUCTION.pack(*step) for step in steps)
