"""Numbers, poses and inertias in the elements of a URDF file."""

from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.errors import RobotModelError
from pretouch.types import FloatArray

_LARGEST = 1e6
"""Largest number in a file: any larger one is a mistake."""


def required(element: Element | None, key: str) -> str:
    """Return an attribute; RobotModelError if it is missing."""
    value = element.get(key) if element is not None else None
    if element is None or value is None:
        tag = "element" if element is None else f"<{element.tag}>"
        raise RobotModelError(f"The URDF file has an element {tag} without {key!r}: add it.")
    return value


def number(element: Element, key: str, owner: str, default: float | None = None) -> float:
    """Return an attribute as a finite number; without a default it must be there."""
    text = element.get(key)
    if text is None and default is not None:
        return default
    return _finite(required(element, key), element, key, owner)


def vector(element: Element, key: str, count: int, owner: str, default: str | None = None) -> FloatArray:
    """Return an attribute as so many finite numbers."""
    text = element.get(key, default) if default is not None else required(element, key)
    words = (text or "").split()
    if len(words) != count:
        raise RobotModelError(f"{owner}: {key} of <{element.tag}> is {text!r}: give {count} numbers.")
    return np.array([_finite(word, element, key, owner) for word in words])


def origin_of(element: Element) -> FloatArray:
    """Return the pose (4, 4) in the element's <origin>; the identity if it has none."""
    T, origin = np.eye(4), element.find("origin")
    if origin is not None:
        owner = element.get("name") or f"<{element.tag}>"
        T[:3, 3] = vector(origin, "xyz", 3, owner, "0 0 0")
        T[:3, :3] = Rotation.from_euler("xyz", vector(origin, "rpy", 3, owner, "0 0 0")).as_matrix()
    return T


def inertia_of(element: Element, owner: str) -> FloatArray:
    """Return the symmetric matrix (3, 3) of an <inertia> [kg m^2]."""
    xx, xy, xz, yy, yz, zz = (number(element, f"i{key}", owner, 0.0) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _finite(text: str, element: Element, key: str, owner: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= _LARGEST:
        raise RobotModelError(f"{owner}: {key} of <{element.tag}> is {text[:50]!r}: give a finite number.")
    return value
