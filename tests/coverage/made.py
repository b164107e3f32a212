"""An arm of one upright capsule, with a second link that may hold a bar before it."""

import numpy as np

from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.body import Surface
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit

RADIUS, HEIGHT = 0.05, 0.008
_XML = """<mujoco><worldbody><body name="one">
<joint name="turn" type="hinge" axis="0 0 1" range="-3 3" limited="true"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom name="one_0" type="capsule" fromto="0 0 0 0 0 0.4" size="0.05"/>
<body name="two" pos="0 0 0.4">
<joint name="tilt" type="hinge" axis="0 1 0" range="-3 3" limited="true"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<geom name="two_0" type="capsule" fromto="{bar}" size="0.01"/></body></body></worldbody></mujoco>"""


def arm(folder, bar="0 0 0.3 0 0 0.4"):
    """The model; `bar` places the second link's capsule, seen from the top of the first."""
    file = folder / "arm.xml"
    file.write_text(_XML.format(bar=bar))
    two = np.ones(2)
    return RobotModel(RobotDescription("made", file, "two", 2 * two, 10 * two, 50 * two, 0 * two, "a test"))


def unit_at(height=0.2, name="side", sensor=PAPER_SENSOR):
    """A unit on the side of the first link at +x that looks along +x."""
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    T[:3, 3] = RADIUS + HEIGHT, 0.0, height
    return SensorUnit(name, "one", T, sensor=sensor)


def skin(model, *units):
    return Skin(units or (unit_at(),), model)


def below_it(model):
    """The one surface point below that unit."""
    link = model.link_index("one")
    return Surface(
        np.array([link]),
        np.array([[RADIUS, 0.0, 0.2]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.array([0.01]),
        np.array([0]),
        np.array([0, 1]),
    )


ROOM = no_fixtures()
