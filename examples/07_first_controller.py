"""A first controller program: a simulated Panda, two sensor units, a line, and a board that stands in its way.

    python examples/07_first_controller.py

docs/tutorial/first-controller.md explains it step by step.
"""

import numpy as np

import pretouch as pt

# an arm, and two units on its hand that look to the left and to the right
arm = pt.RobotModel(pt.panda())
units = [
    pt.sensor_unit(id="left", link="panda_hand", position_m=[0, -0.108, 0.045], quaternion_wxyz=[0.7071, 0.7071, 0, 0]),
    pt.sensor_unit(
        id="right", link="panda_hand", position_m=[0, 0.108, 0.045], quaternion_wxyz=[0.7071, -0.7071, 0, 0]
    ),
]
skin = pt.Skin(units, arm)

# a room with a board, and a path that leads into it
start, end = (0.45, -0.2, 0.5), (0.45, 0.3, 0.5)
board = pt.Box("board", center=(0.45, 0.25, 0.5), half_size=(0.2, 0.02, 0.2), stiffness=25_000.0)
room = pt.SceneSpec(boxes=(board,))

# the simulated arm and its sensors; the controller knows the room's floor, but not the board
plant = pt.Plant(arm, room, pt.PlantParams(), pt.brought_to(arm, np.array(start)), seed=1)
sensors = pt.RangeFinders(plant, skin, pt.RangeFinderParams(), seed=1)
profile = pt.profile("pretouch:approach.untouched_s=0")  # it may touch what it sees; "pretouch" waits before it
controller = pt.Controller(arm, skin, pt.fixtures(room), pt.segment(start, end), profile)


class Narrator:
    """A recorder that prints what the arm does and why, at each new mode and every half second."""

    def __init__(self) -> None:
        self.time, self.mode = -1.0, ""

    def record(self, cycle: pt.Cycle) -> None:
        """Print the first step of a mode, and one every half second."""
        step = cycle.step
        if step.mode.value != self.mode or step.stamp - self.time >= 0.5:
            self.time, self.mode = step.stamp, step.mode.value
            speed, sentence = np.linalg.norm(step.ee_velocity), pt.explain(step, skin.ids, arm.links).sentence
            print(f"{step.stamp:4.1f} s  {self.mode:5}  {speed:.2f} m/s  {sentence}")


clock = pt.PlantClock(plant, controller.limits.period)
pt.loop.run(controller, plant, sensors, clock, Narrator(), lambda step: step.stamp >= 5.0)
