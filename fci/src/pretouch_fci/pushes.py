"""Pushes as they are typed: on the command line, in a terminal, by a program."""

import math
from dataclasses import replace

from pretouch.errors import ParameterError
from pretouch.sim.tcp_push import AXES, TcpPush

_LASTING_S = 0.5
"""How long a push lasts unless it says so [s]."""
_TYPED_N, _TYPED_S = 15.0, 1.5
"""Force [N] and duration [s] of a push of which only the axis is typed: what a guided push asks for."""
_MOST_N = 1000.0
"""Largest push along an axis [N]."""


def push_of(text: str) -> TcpPush:
    """Read a push from T:FX,FY,FZ or T:FX,FY,FZ:DURATION."""
    parts = text.split(":")
    try:
        start, duration = float(parts[0]), float(parts[2]) if len(parts) == 3 else _LASTING_S
        x, y, z = map(float, parts[1].split(","))
    except (ValueError, IndexError):
        start = duration = x = y = z = math.nan
    if len(parts) > 3 or not all(map(math.isfinite, (start, duration, x, y, z))) or start < 0 or duration <= 0:
        raise ParameterError(
            f"The push is {text!r}: give start, force and optionally duration, such as 2.0:0,15,0:0.5 [s, N, s]."
        )
    if max(map(abs, (x, y, z))) > _MOST_N:
        raise ParameterError(f"The push is {text!r}: give at most {_MOST_N:g} N along each axis.")
    return TcpPush(start, (x, y, z), duration)


def typed_push(text: str, now: float) -> TcpPush:
    """Read what is typed now [s]: an axis, as +y or -x, FX,FY,FZ or FX,FY,FZ:DURATION, or a push that comes T from now.

    The latter as of `push_of` [s, N, s].
    """
    plain = text.strip().lower()
    if plain in AXES:
        x, y, z = AXES[plain]
        return TcpPush(now, (_TYPED_N * x, _TYPED_N * y, _TYPED_N * z), _TYPED_S)
    at_once = "," in plain.partition(":")[0]
    try:
        push = push_of(f"0:{plain}" if at_once else plain)
    except ParameterError:
        raise ParameterError(
            f"{plain!r} is not a push: type an axis, such as +y, or a force, such as 0,15,0 [N], of at most {_MOST_N:g}"
            " N."
        ) from None
    return replace(push, start=now + push.start)
