"""A simulated arm with three units that makes a short calibration motion, recorded as the wire brings it."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch import loop
from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.ports import NoUnits
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch.traces import JointTrace
from pretouch.units.fleet import FleetParams
from pretouch.units.skin_recording import SkinRecording
from tests.wire_skin import WireSkin


def swinging(model: RobotModel, duration: float = 17.0) -> Plan:
    """All joints at once, about the ready posture."""
    tones = np.geomspace(0.3, 1.2, 14).reshape(2, 7)
    swing = Swing(0.5, duration - 1.0, 1.0, 0.35 / (2 * np.pi * tones), tones, np.arange(14.0).reshape(2, 7))
    q = model.description.q_ready
    return Plan(np.array([0.0, 0.5, duration - 0.5, duration]), np.array([q] * 4), (swing,))


def record_motion(model: RobotModel, skin: Skin, place: Path) -> JointTrace:
    """Record units and joints while the arm swings; return where the joints were."""
    plan = swinging(model)
    plant = Plant(model, SceneSpec(), PlantParams(), plan.start, 0)
    fleet = FleetParams(imu=ImuParams(misalignment_deg=0.0))
    with WireSkin(plant, skin, RangeFinderParams(), fleet, 0) as wire, SkinRecording(place) as recording:
        plant.advance(2.0)  # the receiver knows the units' clocks

        controller, stamps, positions = plan_controller(model, plan.start), [], []
        commander = PlanCommander(controller, plan, lambda: plant.time)

        class Recorder:
            def record(self, cycle: loop.Cycle) -> None:
                state = cycle.inputs.robot
                stamps.append(state.stamp)
                positions.append(np.array(state.q))
                recording.joints(np.array([state.stamp]), positions[-1][None], None, model.joints)
                recording.add(wire.receiver.take_samples(), skin.ids)

        clock, options = PlantClock(plant, 0.01), loop.Options(desired=commander)
        loop.run(controller, plant, NoUnits(), clock, Recorder(), commander.done, options)
    assert commander.stopped == ""
    return JointTrace(np.array(stamps), np.array(positions))


def assert_same_places(found: Skin, true: Skin, within_deg: float = 0.1) -> None:
    """Each unit that was found sits where it does in truth."""
    for unit in found.units:
        there = true.units[true.ids.index(unit.id)]
        assert unit.link == there.link
        T, wanted = unit.T_link_sensor, there.T_link_sensor
        assert np.linalg.norm(T[:3, 3] - wanted[:3, 3]) < 0.001
        assert np.rad2deg(Rotation.from_matrix(T[:3, :3].T @ wanted[:3, :3]).magnitude()) < within_deg
