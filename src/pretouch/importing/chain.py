"""Joints of a robot that make the arm, one chain of hinges from the first link to the end-effector; their limits."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.tree import Joint, Link, RobotTree
from pretouch.types import FloatArray

_ARM_JOINTS = 6
"""Where a chain with as many joints branches, it ends in fingers; one with fewer has several arms."""
_GRIPPER, _FINGER = ("gripper", "finger", "jaw"), ("finger", "jaw")
"""Names of a finger's joint or link; a link named gripper may be the arm's last."""
_NAMES = ("tcp", "tool", "grasp", "ee", "eef", "effector", "tip")
"""Names of an end-effector's frame, the surest first."""
_ENDLESS = 2 * np.pi
_SPEED, _ACCELERATION, _TORQUE = 1.0, 5.0, 50.0
"""Where nothing is known: slow, gentle and middling [rad/s, rad/s^2, Nm]."""
_LARGEST = {"position": 4 * np.pi, "velocity": 30.0, "acceleration": np.inf, "torque": 5000.0}
"""Limits that no joint of an arm exceeds [rad, rad/s, rad/s^2, Nm]: larger ones count as none."""


@dataclass(frozen=True, eq=False)
class ArmChain:
    """One arm of a robot: all other joints are fixed, at 0 or the nearest limit."""

    robot: RobotTree
    ee: int
    """Index of the end-effector's link."""
    joints: tuple[Joint, ...]
    """The n joints from base to end-effector."""

    def moves(self, link: int) -> bool:
        """Return True if one of its joints moves a link against its parent."""
        return any(joint in self.joints for joint in self.robot.links[link].joints)


def arm_of(robot: RobotTree, ee: str = "") -> ArmChain:
    """Choose the chain to an end-effector, or the likeliest one; fix all joints off it.

    Raises RobotModelError where there is no such chain, or where several arms leave the choice open.
    """
    end, *others = [robot.index(ee)] if ee else _likely_ends(robot, _last_moved(robot))
    if others:
        names = ", ".join(robot.links[i].name for i in others)
        robot.remarks.append(
            f"The end-effector is assumed to be {robot.links[end].name}; choose another one with --ee: {names}."
        )
    joints = tuple(joint for i in robot.ancestors(end) for joint in robot.links[i].joints)
    _check_chain(robot, end, joints)
    fixed = [joint.name for link in robot.links for joint in link.joints if joint not in joints]
    if fixed:
        robot.remarks.append(
            f"Joints off the arm, fixed at 0 or at the nearest limit: {', '.join(fixed)}. Set the positions of fingers"
            " in the file, or give the link that a joint moves as --ee if it is one of the arm's."
        )
    return ArmChain(robot, end, joints)


def _hinges(link: Link) -> int:
    """Number of joints that may be an arm's: hinges that nothing leads, other than a gripper's."""
    finger = any(word in link.name.lower() for word in _FINGER)
    return sum(
        joint.kind == "hinge" and not (joint.coupled or finger or any(w in joint.name.lower() for w in _GRIPPER))
        for joint in link.joints
    )


def _last_moved(robot: RobotTree) -> int:
    """Return the link that most of an arm's hinges move, or the last one before a whole arm ends in equal branches.

    Several arms are a RobotModelError that names their ends.
    """
    hinges = [_hinges(link) for link in robot.links]
    ways = [robot.ancestors(i) for i in range(len(hinges))]
    moving = [sum(hinges[i] for i in way) for way in ways]
    ends = [i for i, own in enumerate(hinges) if own and moving[i] == max(moving)]
    last = [0, *(i for i in range(len(hinges)) if hinges[i] and all(i in ways[end] for end in ends))][-1]
    if len(ends) > 1 and moving[last] < _ARM_JOINTS:
        names = ", ".join(robot.links[i].name for i in ends)
        raise RobotModelError(
            f"{robot.name} has {len(ends)} arms, or one that branches: choose one by --ee, such as {names}."
        )
    return last


def _likely_ends(robot: RobotTree, last: int) -> list[int]:
    """Return the ends of what is fixed to a link, itself if nothing is: the likeliest end-effector first."""
    ends, waiting = list[int](), [last]
    while waiting:
        at = waiting.pop(0)
        onward = [i for i, link in enumerate(robot.links) if link.parent == at and not link.joints]
        waiting += onward
        ends += [] if onward else [at]

    def rank(link: int) -> int:
        words = robot.links[link].name.lower().replace("-", "_").split("_")
        return next((k for k, name in enumerate(_NAMES) if any(word.startswith(name) for word in words)), len(_NAMES))

    return sorted(ends, key=rank)


def _check_chain(robot: RobotTree, end: int, joints: tuple[Joint, ...]) -> None:
    """Refuse what is no chain of hinges each of which moves by itself and has limits."""
    if not joints:
        moved = ", ".join(link.name for link in robot.links[1:] if link.joints) or "none, for no joint moves one"
        raise RobotModelError(
            f"No joint moves {robot.links[end].name}: choose another end-effector by --ee, such as {moved}."
        )
    for joint in joints:
        low, high = joint.limits or (0.0, 1.0)
        if joint.kind != "hinge":
            trouble = "is prismatic" if joint.kind == "slide" else "is not a hinge"
        elif joint.coupled:
            trouble = "mimics another one, as fingers do"
        elif not low < high:
            trouble = f"has the range {low:g} to {high:g}"
        else:
            continue
        before = next(link.parent for link in robot.links if joint in link.joints)
        raise RobotModelError(
            f"The joint {joint.name} {trouble}, but only hinges that move by themselves from a lower to an upper limit"
            " are supported: correct the file, or choose an end-effector before it by --ee, such as"
            f" {robot.links[max(before, 0)].name}."
        )


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of n joints."""

    q_min: FloatArray
    """(n,) [rad]."""
    q_max: FloatArray
    """(n,) [rad]."""
    qd_max: FloatArray
    """(n,) [rad/s]."""
    qdd_max: FloatArray
    """(n,) [rad/s^2]."""
    tau_max: FloatArray
    """(n,) [Nm]."""


def _possible(arm: ArmChain, what: str, unit: str, largest: float, values: list[float | None]) -> list[float | None]:
    """Return limits without those that no joint of an arm has, which are named."""
    pairs = zip(arm.joints, values, strict=True)
    if beyond := [f"{joint.name} ({v:.6g} {unit})" for joint, v in pairs if v and v > largest]:
        several = len(beyond) > 1 and "rad" in unit
        guess = "they look like degrees in place of radians" if several else "perhaps they are of another unit"
        arm.robot.remarks.append(
            f"The {what} limits of {', '.join(beyond)} are not used, for no joint of an arm has such: {guess}. Correct"
            " them in the file."
        )
    return [v if v and v <= largest else None for v in values]


def limits_of(
    arm: ArmChain, qd_max: tuple[float, ...] = (), qdd_max: tuple[float, ...] = (), tau_max: tuple[float, ...] = ()
) -> Limits:
    """Return an arm's limits; those given, one for all joints or one for each, take the place of the file's."""
    n, remarks = len(arm.joints), arm.robot.remarks

    def among(names: list[str]) -> str:
        return "all joints" if len(names) == n else ", ".join(names)

    def settled(
        what: str, unit: str, option: str, options: tuple[float, ...], in_file: list[float | None], usual: float
    ) -> FloatArray:
        if options and (len(options) not in (1, n) or not all(np.isfinite(options)) or min(options) <= 0):
            listed = ", ".join(f"{v:g}" for v in options)
            raise RobotModelError(f"{option} is {listed}: give one positive number [{unit}], or {n}, by commas.")
        if options:
            return np.broadcast_to(np.array(options, dtype=np.float64), n).copy()
        largest = _ENDLESS if what == "velocity" and degrees else _LARGEST[what]
        values = _possible(arm, what, unit, largest, in_file)
        if missing := [joint.name for joint, value in zip(arm.joints, values, strict=True) if value is None]:
            remarks.append(
                f"The file has no usable {what} limit of {among(missing)}: {usual:g} {unit} is assumed; give {option}."
            )
        return np.array([usual if value is None else value for value in values])

    ends = [max(map(abs, joint.limits)) if joint.limits else None for joint in arm.joints]
    usable = _possible(arm, "position", "rad", _LARGEST["position"], ends)
    degrees = ends.count(None) + 1 < usable.count(None)  # then speeds are too, slow ones included
    if endless := [joint.name for joint, end in zip(arm.joints, usable, strict=True) if end is None]:
        remarks.append(
            f"The file has no usable position limits of {among(endless)}: -2 pi to 2 pi is assumed; give each a lower"
            " and an upper one there, or correct the range in arm.xml."
        )
    within = [end for end in usable if end is not None]
    if len(within) > 1 and max(within) < np.deg2rad(_LARGEST["position"]):
        remarks.append(
            f"All position limits are within {max(within):.2g} rad: perhaps they are radians that were taken for"
            ' degrees. In an MJCF file, <compiler angle="radian"/> says what they are.'
        )
    ranges = np.array(
        [
            joint.limits if joint.limits and end else (-_ENDLESS, _ENDLESS)
            for joint, end in zip(arm.joints, usable, strict=True)
        ]
    )
    speed, torque = [joint.velocity for joint in arm.joints], [joint.effort for joint in arm.joints]
    speeds = settled("velocity", "rad/s", "--qd-max", qd_max, speed, _SPEED)
    accelerations = settled("acceleration", "rad/s^2", "--qdd-max", qdd_max, [None] * n, _ACCELERATION)
    torques = settled("torque", "Nm", "--tau-max", tau_max, torque, _TORQUE)
    return Limits(ranges[:, 0], ranges[:, 1], speeds, accelerations, torques)
