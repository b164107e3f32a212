"""The colours of the page, as (red, green, blue) from 0 to 255, and what they mean."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pretouch.types import FloatArray

Colour = tuple[int, int, int]

ARM: Colour = (222, 226, 231)
PEDESTAL: Colour = (170, 177, 186)
UNIT: Colour = (52, 63, 78)
UNIT_SILENT: Colour = (214, 40, 57)
CONE: Colour = (84, 150, 214)
SEEING: Colour = (242, 150, 40)
"""Colour of a unit that sees an obstacle, and of its cone."""
LIMITING: Colour = (214, 40, 57)
"""Colour of a unit whose obstacle restricts the arm, and of a pair of points that does."""
SENSED: Colour = (38, 166, 91)
PATH: Colour = (49, 104, 196)
RECOVERING: Colour = (38, 166, 91)
REACTING: Colour = (138, 79, 190)
HOLDING: Colour = (226, 155, 28)
FOLLOWING: Colour = (110, 121, 136)
PAIR: Colour = (132, 168, 142)
FORCE: Colour = (232, 119, 34)
ASKED: Colour = (49, 104, 196)
"""Colour of the velocity that a commander requests."""
TRUE_FORCE: Colour = (38, 44, 54)
PLACE: Colour = (190, 24, 120)
"""Colour of the forces at the estimated places of contact."""
HAND: Colour = (232, 178, 146)
CUFF: Colour = (58, 92, 148)
BOARD: Colour = (201, 176, 140)

EXPECTED: tuple[Colour, ...] = (ARM, (250, 208, 138), (242, 130, 58), (204, 28, 36))
"""The arm where contact is not expected, less, more, and most."""
REMEMBERED: tuple[Colour, ...] = (SENSED, (203, 228, 213))
"""A place that is seen now, and one that nothing has seen for long."""

_AXES: tuple[Colour, ...] = ((204, 0, 0), (0, 153, 0), (0, 0, 204))
_LINES = {
    "path": PATH,
    "followed": FOLLOWING,
    "avoiding": LIMITING,
    "recovering": RECOVERING,
    "reacting": REACTING,
    "holding": HOLDING,
    "force estimate": FORCE,
    "true force": TRUE_FORCE,
    "asked": ASKED,
    "allowed": RECOVERING,
}


def between(colours: tuple[Colour, ...], share: FloatArray) -> FloatArray:
    """Colours (V, 3) that are shares (V,) of the way from the first to the last, from 0 to 1."""
    at = np.clip(share, 0.0, 1.0) * (len(colours) - 1)
    steps = np.arange(len(colours))
    return np.stack([np.interp(at, steps, [colour[i] for colour in colours]) for i in range(3)], axis=1)


def as_vertex(colours: ArrayLike) -> NDArray[np.uint8]:
    """Turn sRGB (..., 3) into linear light, as the page takes colours of vertices and instances, and no others."""
    screen = np.asarray(colours, dtype=np.float64) / 255
    linear = np.where(screen <= 0.04045, screen / 12.92, ((screen + 0.055) / 1.055) ** 2.4)
    return np.rint(255 * linear).astype(np.uint8)


def css(colour: Colour) -> str:
    """Write a colour for a style sheet."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def legend() -> str:
    """Legend of the colours in space, as HTML."""
    marks = "".join(_mark(name, css(colour), 14, 4, 2) for name, colour in _LINES.items())
    marks += _mark("cone of a unit that sees something", css(SEEING), 8, 8, 1)
    marks += _mark("distance to the nearest unit", css(FOLLOWING), 14, 1, 0)
    marks += _mark("closest pair", css(PAIR), 14, 2, 0) + _mark("silent unit", css(UNIT_SILENT), 8, 8, 1)
    bands = {"seen, and remembered": REMEMBERED, "contact expected": EXPECTED, "axes x, y, z of the base": _AXES}
    for name, colours in bands.items():
        marks += _mark(name, f"linear-gradient(90deg,{','.join(map(css, colours))})", 46, 8, 4)
    return f"<div style='padding:4px 12px 10px;font-size:11px;display:flex;flex-wrap:wrap;gap:3px 12px'>{marks}</div>"


def _mark(name: str, background: str, width: int, height: int, radius: int) -> str:
    """A colour in a shape [px], and its name."""
    shape = f"width:{width}px;height:{height}px;border-radius:{radius}px;background:{background}"
    return (
        f"<span style='white-space:nowrap'><span style='display:inline-block;vertical-align:middle;{shape};"
        f"margin:0 5px 2px 0'></span>{name}</span>"
    )
