"""A source of points of your own in the loop: here a tracker of a ball. Prints how the arm slows for the ball.

    python examples/04_your_own_points.py

A source is an object with `read`. It returns the newest points in the base frame, each with the instant of its
measurement and its standard deviation, and the instant of the source's last report. See docs/how-to/vision.md.
"""

import numpy as np

import pretouch as pt
from pretouch.robot.postures import brought_to
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec, fixtures


class BallTracker:
    """Returns the near side of a ball at 30 Hz; put your camera, lidar or motion capture in its place."""

    def __init__(self, clock: Plant) -> None:
        self._clock, self._newest = clock, pt.SeenPoints(-np.inf, np.zeros(0), np.zeros((0, 3)), np.zeros(0))

    def read(self) -> pt.SeenPoints:
        """Return the newest set of points, the same set until the next measurement."""
        now = self._clock.time
        if now - self._newest.heard >= 1 / 30:
            surface = np.array([0.5, -0.42, 0.3]) + 0.05 * np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
            self._newest = pt.SeenPoints(now, np.full(3, now), surface, np.full(3, 0.005))
        return self._newest


class StepRecorder:
    """A recorder that stores each step."""

    def __init__(self) -> None:
        self.steps: list[pt.ControlStep] = []

    def record(self, cycle: pt.Cycle) -> None:
        """Store a step."""
        self.steps.append(cycle.step)


class NoSkin:
    """An arm without sensor units."""

    def read(self) -> pt.RangeReadings:
        """Return no reading."""
        return pt.RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


arm, path, scene = pt.RobotModel(pt.panda()), pt.Circle(), SceneSpec()
control = pt.Controller(arm, pt.Skin([], arm), fixtures(scene), path, pt.profile("pretouch"))
for name, tracks in (("without", False), ("with", True)):
    plant, recorder = Plant(arm, scene, PlantParams(), brought_to(arm, path.point(0.0)), seed=1), StepRecorder()
    options = pt.loop.Options(points=BallTracker(plant) if tracks else None)
    clock = PlantClock(plant, control.limits.period)
    pt.loop.run(control, plant, NoSkin(), clock, recorder, lambda step: step.stamp >= 8.0, options)
    nearest = min(float(step.obstacles.body_distance.min(initial=np.inf)) for step in recorder.steps)
    print(f"{name} the ball's points: {recorder.steps[-1].path_phase:.2f} m along the path in 8 s", end="")
    print(f", at {nearest:.2f} m from the ball at the nearest." if tracks else ".")
