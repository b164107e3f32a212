"""A protected program with its own loop and commander: a resolved-rate loop without knowledge of the board.

    python examples/08_your_own_commander.py

It commands joint velocities into a board. Prints the contact force with units that see the board, and without. A
commander returns a desired motion: `pt.desired` has twists, joint velocities, poses, joint positions, and horizons of
them, each stamped by the clock of the steps.
"""

from collections import Counter

import numpy as np

import pretouch as pt

arm = pt.RobotModel(pt.panda())
start, goal = np.array([0.45, -0.2, 0.5]), np.array([0.45, 0.3, 0.5])
room = pt.SceneSpec(boxes=(pt.Box("board", center=(0.45, 0.25, 0.5), half_size=(0.2, 0.02, 0.2), stiffness=25_000.0),))


def resolved_rate(q: np.ndarray) -> np.ndarray:
    """Joint velocities that bring the hand to the goal at 0.3 m/s at most, by the Jacobian's pseudo-inverse."""
    kin = arm.kinematics(q)
    way = 2.0 * (goal - kin.position[arm.ee])
    return np.linalg.pinv(arm.ee_jacobian(kin)[:3]) @ (way * min(1.0, 0.3 / float(np.linalg.norm(way))))


for name, profile in (("unprotected", "blind"), ("through pretouch", "pretouch")):
    skin = pt.skin_for(arm) if profile == "pretouch" else pt.Skin([], arm)
    plant = pt.Plant(arm, room, pt.PlantParams(), pt.brought_to(arm, start), seed=1)
    units = pt.RangeFinders(plant, skin, pt.RangeFinderParams(), seed=1)
    shield = pt.shield(arm, skin, plant.read(), profile, pt.fixtures(room))
    clock, force, limits = pt.PlantClock(plant, shield.controller.limits.period), 0.0, Counter[str]()
    while (now := clock.tick()) < 5.0:
        robot = plant.read()
        desired = pt.desired.joint_velocities(now, resolved_rate(robot.q))
        step = shield(pt.Inputs(now, robot, units.read(), desired=desired))
        plant.command(step.command)
        force = max(force, float(np.linalg.norm(plant.true_force)))
        limits[step.limited.by.value] += 1
    print(f"{name}: hits the board with {force:.0f} N")
    print("   steps by their limit: " + ", ".join(f"{by} {count}" for by, count in limits.most_common()))
