"""Inertials that a simulation can take: those of the file where they are possible, estimates where it has none."""

from dataclasses import replace

import numpy as np

from pretouch.importing.body import LinkBody
from pretouch.importing.capsule_fit import Rods
from pretouch.importing.chain import Arm
from pretouch.importing.source import Inertial
from pretouch.types import FloatArray

DENSITY = 1000.0
"""Of a link whose mass is unknown, over its capsules [kg/m^3]."""
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6
"""Of a moved link of which nothing is known [kg, kg m^2]."""
_LARGEST_MASS = 500.0
"""What no link of an arm has [kg]."""


def inertials_of(arm: Arm, bodies: tuple[LinkBody, ...]) -> tuple[tuple[Inertial | None, ...], tuple[str, ...]]:
    """Return an inertial of each link, None where it has none and needs none, and a sentence for each estimate."""
    links, rods = arm.source.links, {body.link: body.rods for body in bodies}
    found: list[Inertial | None] = []
    estimated, mended = [], []
    for i, link in enumerate(links):
        own = link.inertial
        if own is not None and own.mass > 0:
            balanced = _balanced(own.inertia)
            if not np.allclose(balanced, own.inertia, rtol=1e-6, atol=1e-12):
                mended.append(link.name)
            found.append(replace(own, inertia=balanced))
        elif _needs_one(arm, i):
            found.append(_estimated(rods.get(i)))
            estimated.append(f"{link.name} ({found[-1].mass:.2g} kg)" if found[-1] else link.name)
        else:
            found.append(None)
    remarks = []
    heavy = [
        f"{link.name} ({own.mass:g} kg)"
        for link, own in zip(links, found, strict=True) if own is not None and own.mass > _LARGEST_MASS
    ]  # fmt: skip
    if heavy:
        remarks.append(f"Implausible masses, correct them in the file: {', '.join(heavy)}.")
    if estimated:
        remarks.append(
            f"Without mass or inertia, so estimated at {DENSITY:g} kg/m^3: {', '.join(estimated)}. Simulated forces are"
            " only as accurate as that: give each its mass and inertia in the file."
        )
    if mended:
        remarks.append(f"With an impossible inertia, whose smallest moment was raised: {', '.join(mended)}.")
    return tuple(found), tuple(remarks)


def _needs_one(arm: Arm, link: int) -> bool:
    """Whether a joint moves the link and neither it nor what is fixed to it has a mass."""
    links = arm.source.links
    if not links[link].joints:
        return False
    fixed = {link}
    for i in range(link + 1, len(links)):
        if links[i].parent in fixed and not links[i].joints:
            fixed.add(i)
    return not any((own := links[i].inertial) is not None and own.mass > 0 for i in fixed)


def _balanced(inertia: FloatArray) -> FloatArray:
    """Return the inertia (3, 3), its principal values raised until each is at most the sum of the others."""
    values, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    values = np.maximum(values, _LEAST_INERTIA * 1e-3)
    missing = values[2] - values[0] - values[1]
    if missing > 0:
        values[:2] += missing / 2 * (1 + 1e-9)
    return np.asarray(axes @ np.diag(values) @ axes.T)


def _estimated(rods: Rods | None) -> Inertial:
    """Mass and inertia of capsules of even density; where two of them overlap it counts twice."""
    if rods is None:
        return Inertial(_LEAST_MASS, np.zeros(3), _LEAST_INERTIA * np.eye(3))
    along = rods.b - rods.a
    length = np.linalg.norm(along, axis=1)
    r = rods.radius
    mass = DENSITY * np.pi * r**2 * (length + 4 / 3 * r)
    middle = (rods.a + rods.b) / 2
    com = (mass[:, None] * middle).sum(axis=0) / mass.sum()
    total = np.zeros((3, 3))
    for k in range(len(rods)):
        axis = along[k] / max(length[k], 1e-12)
        across = mass[k] * ((length[k] + 2 * r[k]) ** 2 / 12 + r[k] ** 2 / 4)
        turning = mass[k] * r[k] ** 2 / 2
        off = middle[k] - com
        total += across * np.eye(3) + (turning - across) * np.outer(axis, axis)
        total += mass[k] * ((off @ off) * np.eye(3) - np.outer(off, off))
    return Inertial(float(mass.sum()), com, total)
