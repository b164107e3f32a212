"""The colours of the page, as (red, green, blue) from 0 to 255."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pretouch.types import FloatArray, Mode

Colour = tuple[int, int, int]

ARM: Colour = (222, 226, 231)
PEDESTAL: Colour = (170, 177, 186)
UNIT: Colour = (52, 63, 78)
UNIT_SILENT: Colour = (214, 40, 57)
CONE: Colour = (84, 150, 214)
SEEING: Colour = (242, 150, 40)
"""Of a unit, and of its cone, that sees an obstacle."""
LIMITING: Colour = (214, 40, 57)
"""Of one whose obstacle, and of a pair whose nearness, keeps the arm from what it would do."""
SENSED: Colour = (38, 166, 91)
PATH: Colour = (49, 104, 196)
RECOVERING: Colour = (38, 166, 91)
REACTING: Colour = (138, 79, 190)
HOLDING: Colour = (226, 155, 28)
FOLLOWING: Colour = (110, 121, 136)
PAIR: Colour = (132, 168, 142)
FORCE: Colour = (232, 119, 34)
ASKED: Colour = (49, 104, 196)
"""Of the velocity that a commander asked for."""
TRUE_FORCE: Colour = (38, 44, 54)
PLACE: Colour = (190, 24, 120)
"""Of the forces at the places where the arm is said to be touched."""
HAND: Colour = (232, 178, 146)
CUFF: Colour = (58, 92, 148)
BOARD: Colour = (201, 176, 140)

MODES: dict[Mode, Colour] = {Mode.TRACK: RECOVERING, Mode.REACT: REACTING, Mode.HOLD: HOLDING}

EXPECTED: tuple[Colour, ...] = (ARM, (250, 208, 138), (242, 130, 58), (204, 28, 36))
"""The arm where contact is not expected, less, more, and most."""

UNITS: tuple[Colour, ...] = (
    (49, 104, 196), (232, 119, 34), (38, 166, 91), (214, 40, 57), (138, 79, 190), (140, 100, 75), (214, 110, 176),
    (90, 160, 170), (170, 150, 40), (110, 121, 136),
)  # fmt: skip
"""A colour for each unit, over again from the eleventh on."""


def expected(expectation: FloatArray) -> FloatArray:
    """Colours (V, 3) of a surface where contact is expected by so much (V,), from 0 to 1."""
    at = np.clip(expectation, 0.0, 1.0) * (len(EXPECTED) - 1)
    steps = np.arange(len(EXPECTED))
    return np.stack([np.interp(at, steps, [colour[i] for colour in EXPECTED]) for i in range(3)], axis=1)


def linear(screen: FloatArray) -> FloatArray:
    """Turn sRGB (...), from 0 to 1, into linear light."""
    return np.where(screen <= 0.04045, screen / 12.92, ((screen + 0.055) / 1.055) ** 2.4)


def as_vertex(colours: ArrayLike) -> NDArray[np.uint8]:
    """Colours (..., 3) for vertices and instances, which the page takes for linear light; all others it converts."""
    return np.rint(255 * linear(np.asarray(colours, dtype=np.float64) / 255)).astype(np.uint8)


def css(colour: Colour) -> str:
    """Write a colour for a style sheet."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
