"""Which of a robot's joints make the arm: one chain of hinges from the first link to the end-effector."""

from dataclasses import dataclass

from pretouch.errors import RobotModelError
from pretouch.importing.tree import Joint, Link, Robot

_ARM_JOINTS = 4
"""A branch with as many hinges that nothing leads is an arm; one with fewer is a finger."""
_USUAL_JOINTS = 6
"""An arm with fewer may have been cut short where it branches."""
_GRIPPER, _FINGER = ("gripper", "finger", "jaw"), ("finger", "jaw")
"""What a single finger's joint, or its link, is called; a link called gripper may be the arm's last."""
_NAMES = ("tcp", "tool", "grasp", "ee", "eef", "effector", "tip")
"""What an end-effector's frame is called, the surest first."""


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm of a robot: all other joints are fixed, at 0 or the nearest limit."""

    robot: Robot
    ee: int
    """Index of the end-effector's link."""
    joints: tuple[Joint, ...]
    """The n joints from base to end-effector."""
    remarks: tuple[str, ...]
    """What was chosen or fixed, a sentence each."""


def arm_of(robot: Robot, ee: str = "") -> Arm:
    """Choose the chain to an end-effector, or the likeliest one; fix all joints off it.

    Raises RobotModelError where there is no such chain, or where several arms leave the choice open.
    """
    remarks = list(robot.beside.remarks)
    if ee:
        end = robot.index(ee)
    else:
        trunk, grips = _trunk(robot)
        end, others = _likeliest_end(robot, trunk)
        if grips:
            remarks.append(
                f"{grips} is treated as a gripper's joint, not as a joint of the arm; --ee {_moved_by(robot, grips)}"
                " includes it."
            )
        if others:
            remarks.append(f"The end-effector is assumed to be {robot.links[end].name}; choose another"
                           f" one with --ee: {', '.join(robot.links[i].name for i in others)}.")  # fmt: skip
    way = robot.ancestors(end)
    joints = tuple(joint for i in way for joint in robot.links[i].joints)
    _check_chain(robot, end, joints)
    remarks += [] if ee or len(joints) >= _USUAL_JOINTS else _branching(robot, trunk)
    fixed = [joint.name for link in robot.links for joint in link.joints if joint not in joints]
    if fixed:
        remarks.append(
            f"{_counted(fixed)} off the arm {'is' if len(fixed) == 1 else 'are'} fixed at 0, or at the nearest limit:"
            f" {', '.join(fixed)}. To close fingers differently, set their positions in the file."
        )
    return Arm(robot, end, joints, tuple(remarks))


def _counted(names: list[str]) -> str:
    return f"{len(names)} joint{'s' if len(names) > 1 else ''}"


def _children(robot: Robot) -> list[list[int]]:
    found: list[list[int]] = [[] for _ in robot.links]
    for i, link in enumerate(robot.links):
        if link.parent >= 0:
            found[link.parent].append(i)
    return found


def _independent(robot: Robot) -> list[int]:
    """Number of joints that nothing leads, of each link and what hangs on it, along its longest branch."""
    count = [sum(not joint.coupled for joint in link.joints) for link in robot.links]
    deepest = [0] * len(count)
    for i in reversed(range(len(count))):
        count[i] += deepest[i]
        parent = robot.links[i].parent
        if parent >= 0:
            deepest[parent] = max(deepest[parent], count[i])
    return count


def _moved_by(robot: Robot, joint: str) -> str:
    return next(link.name for link in robot.links if joint in [one.name for one in link.joints])


def _grips(link: Link) -> str | None:
    """Name of the joint of a link, if it or the link is called as those of grippers are."""
    for joint in link.joints:
        if any(word in joint.name.lower() for word in _GRIPPER) or any(word in link.name.lower() for word in _FINGER):
            return joint.name
    return None


def _trunk(robot: Robot) -> tuple[int, str | None]:
    """Return the last link before the arm ends or branches into fingers, and the joint of a single finger on it.

    Several branches that are arms are a RobotModelError that names their ends.
    """
    children, count = _children(robot), _independent(robot)
    coupled = [any(joint.coupled for joint in link.joints) for link in robot.links]
    at = 0
    while True:
        onward = [i for i in children[at] if count[i] or coupled[i]]
        arms = [i for i in onward if count[i] >= _ARM_JOINTS]
        if len(arms) > 1:
            ends = [robot.links[_last(robot, children, count, i)].name for i in arms]
            raise RobotModelError(f"The robot has {len(arms)} arms: choose one by --ee, such as {', '.join(ends)}.")
        if not onward or (len(onward) > 1 and not arms):
            return at, None
        ahead = (arms or onward)[0]
        if coupled[ahead] and not count[ahead]:
            return at, None
        if count[ahead] == 1 and (joint := _grips(robot.links[ahead])):
            return at, joint
        at = ahead


def _branching(robot: Robot, trunk: int) -> list[str]:
    """Say it, where the arm ends because several branches with joints begin there."""
    children, count = _children(robot), _independent(robot)
    ends = [robot.links[_last(robot, children, count, i)].name for i in children[trunk] if count[i]]
    if len(ends) < 2:
        return []
    return [
        f"The arm is assumed to end at {robot.links[trunk].name}, where it branches towards {', '.join(ends)}: if one"
        " branch belongs to it, choose that one's last link with --ee."
    ]


def _last(robot: Robot, children: list[list[int]], count: list[int], at: int) -> int:
    """Return the last link of an arm: the end of its longest branch before it splits into fingers."""
    while True:
        onward = [i for i in children[at] if count[i]]
        if len(onward) != 1:
            return at if robot.links[at].name else robot.links[at].parent
        at = onward[0]


def _likeliest_end(robot: Robot, trunk: int) -> tuple[int, list[int]]:
    """Return the end-effector among the links fixed to the trunk's last, and the other ones that could be meant."""
    children = _children(robot)
    ends, waiting = [], [trunk]
    while waiting:
        at = waiting.pop(0)
        fixed = [i for i in children[at] if not robot.links[i].joints]
        waiting += fixed
        if not fixed:
            ends.append(at)

    def likelihood(link: int) -> int:
        words = robot.links[link].name.lower().replace("-", "_").split("_")
        return next((k for k, name in enumerate(_NAMES) if any(word.startswith(name) for word in words)), len(_NAMES))

    ends.sort(key=likelihood)
    return ends[0], ends[1:]


def _check_chain(robot: Robot, end: int, joints: tuple[Joint, ...]) -> None:
    """Refuse what is no chain of hinges each of which moves by itself and has limits."""
    name = robot.links[end].name
    if not joints:
        moved = [link.name for i, link in enumerate(robot.links) if link.joints and i]
        raise RobotModelError(
            f"No joint moves {name}: choose another end-effector by --ee"
            + (f", such as {', '.join(moved[-8:])}." if moved else "; the file has no joint that moves.")
        )
    for joint in joints:
        before = next(link.parent for link in robot.links if joint in link.joints)
        way_out = f"choose an end-effector before it by --ee, such as {robot.links[max(before, 0)].name}, or fix it"
        if joint.kind == "slide":
            raise RobotModelError(
                f"The joint {joint.name} is prismatic, but only hinge joints are supported: {way_out} in the file."
            )
        if joint.kind == "other":
            raise RobotModelError(
                f"The joint {joint.name} is not a hinge, but only hinge joints are supported: {way_out}."
            )
        if joint.coupled:
            raise RobotModelError(f"The joint {joint.name} mimics another one, as fingers do: {way_out}.")
        if joint.limits is not None and not joint.limits[0] < joint.limits[1]:
            raise RobotModelError(
                f"The joint {joint.name} has the range {joint.limits[0]:g} to {joint.limits[1]:g}: give it lower and"
                " upper limits in the file."
            )
