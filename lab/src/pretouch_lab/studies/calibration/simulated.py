"""What joints and IMUs measure while a simulated arm makes a calibration motion."""

import numpy as np

from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.values import CalibrationData, UnitData
from pretouch.errors import ExperimentError
from pretouch.loop import Cycle, Options, run
from pretouch.ports import NoUnits
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.imu import ImuParams, Imus, ImuSample, imu_counts
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray

DATA_SHEET = ImuParams(misalignment_deg=0.0)
"""The sensors' own errors. How a board is glued on turns the IMU's frame itself, and no IMU can tell it."""
CLOCK_ERROR_S = 0.02
"""Each unit's clock is off by up to this [s]."""

_LARGEST_COUNT = 32767


def simulate(
    model: RobotModel, skin: Skin, plan: Plan, seed: int, imu: ImuParams = DATA_SHEET,
    clock_error_s: float = CLOCK_ERROR_S, links_known: bool = True,
) -> CalibrationData:  # fmt: skip
    """Let an arm follow a plan, and measure; stamps count from its beginning.

    The seed decides errors of arm, sensors and clocks, and all noise: it gives another skin of as many units the same
    sensors on the same arm.
    """
    plant = Plant(model, SceneSpec(), PlantParams(), plan.start, seed)
    samples: list[ImuSample] = []
    Imus(plant, skin, imu, seed, samples.append)
    joints, begin = followed(plant, model, plan)
    late = clock_errors(len(skin), seed, clock_error_s) - begin
    units = tuple(
        UnitData(unit.id, trace, unit.link if links_known else None, *_full_scale(imu))
        for unit, trace in zip(skin.units, _traces(samples, imu, late), strict=True)
    )
    return CalibrationData(JointTrace(joints.stamp - begin, joints.q), units)


def followed(plant: Plant, model: RobotModel, plan: Plan) -> tuple[JointTrace, float]:
    """Let an arm follow a plan; return the joint positions measured meanwhile, and when it began [s]."""
    controller = plan_controller(model, plan.start)
    commander = PlanCommander(controller, plan, lambda: plant.time)
    states: list[tuple[float, FloatArray]] = []

    class Recorder:
        def record(self, cycle: Cycle) -> None:
            if commander.begin is not None:
                states.append((cycle.inputs.robot.stamp, np.array(cycle.inputs.robot.q)))

    clock = PlantClock(plant, controller.limits.period)
    run(controller, plant, NoUnits(), clock, Recorder(), commander.done, Options(desired=commander))
    if commander.stopped or commander.begin is None:
        raise ExperimentError(f"The simulated arm did not follow the plan to its end. {commander.stopped}")
    return JointTrace(np.array([stamp for stamp, _ in states]), np.array([q for _, q in states])), commander.begin


def clock_errors(count: int, seed: int, most: float = CLOCK_ERROR_S) -> FloatArray:
    """By how much the stamps of each of so many units are late (K,) [s]."""
    return np.random.default_rng([seed, 12]).uniform(-most, most, count)


def _full_scale(imu: ImuParams) -> tuple[float, float]:
    """Largest value of accelerometer [m/s^2] and gyroscope [rad/s]."""
    largest = _LARGEST_COUNT * imu_counts(imu)
    return float(largest[3]), float(largest[0])


def _traces(samples: list[ImuSample], imu: ImuParams, late: FloatArray) -> list[ImuTrace]:
    unit = np.array([sample.unit for sample in samples])
    time = np.array([sample.time for sample in samples])
    values = np.array([sample.counts for sample in samples]).reshape(-1, 6) * imu_counts(imu)
    return [ImuTrace(time[unit == k] + late[k], values[unit == k, 3:], values[unit == k, :3]) for k in range(len(late))]
