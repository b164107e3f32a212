"""A commander of your own drives the arm through the controller: here a resolved-rate loop that knows of no board.

    python examples/08_your_own_commander.py

It asks for joint velocities as if nothing could be in the way, into a board. Prints how hard the arm meets it, with
units that see the board and without. A commander is anything that says what it wants: `pt.desired` has twists, joint
velocities, poses, joint positions, and horizons of them, each stamped by the clock of the steps.
"""

import numpy as np

import pretouch as pt

arm = pt.RobotModel(pt.panda())
start, far = np.array([0.45, -0.2, 0.5]), np.array([0.45, 0.3, 0.5])
room = pt.SceneSpec(boxes=(pt.Box("board", center=(0.45, 0.25, 0.5), half_size=(0.2, 0.02, 0.2), stiffness=25_000.0),))


class ResolvedRate:
    """Brings the hand to a goal by the pseudo-inverse of the Jacobian, at 0.3 m/s at most."""

    def __init__(self, plant: pt.Plant, goal: np.ndarray) -> None:
        self._plant, self._goal = plant, goal

    def __call__(self) -> pt.Desired:
        """Return the joint velocities that are wanted now."""
        robot = self._plant.read()
        kin = arm.kinematics(robot.q)
        way = 2.0 * (self._goal - kin.position[arm.ee])
        velocity = way * min(1.0, 0.3 / float(np.linalg.norm(way)))
        return pt.desired.joint_velocities(robot.stamp, np.linalg.pinv(arm.ee_jacobian(kin)[:3]) @ velocity)


class Force:
    """Keeps the largest true force, and for how long the arm yielded."""

    def __init__(self, plant: pt.Plant) -> None:
        self._plant, self.largest, self.yielding = plant, 0.0, 0

    def record(self, cycle: pt.Cycle) -> None:
        """Look at the plant after a step."""
        self.largest = max(self.largest, float(np.linalg.norm(self._plant.true_force)))
        self.yielding += cycle.step.mode is pt.Mode.REACT


for name, profile in (("unprotected", "blind"), ("through pretouch", "pretouch")):
    skin = pt.paper_skin(arm) if profile == "pretouch" else pt.Skin([], arm)
    plant = pt.Plant(arm, room, pt.PlantParams(), pt.brought_to(arm, start), seed=1)
    units = pt.RangeFinders(plant, skin, pt.RangeFinderParams(), seed=1)
    path = pt.line(tuple(start), tuple(far))  # followed where nobody commands
    control = pt.Controller(arm, skin, pt.fixtures(room), path, pt.profile(profile))
    seen, clock = Force(plant), pt.PlantClock(plant, control.limits.period)
    options = pt.loop.Options(desired=ResolvedRate(plant, far))
    pt.loop.run(control, plant, units, clock, seen, lambda step: step.stamp >= 5.0, options)
    print(f"{name}: meets the board with {seen.largest:.0f} N, yields for {0.01 * seen.yielding:.1f} s")
