"""Errors of the calibration of many random skins in simulation."""

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.findings import seen_from
from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.values import CalibrationData, Place, UnitData
from pretouch.errors import ExperimentError
from pretouch.loop import Cycle, Options, run
from pretouch.ports import NoUnits
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import LARGEST_COUNT, SensorUnit
from pretouch.sim.imu import ImuParams, Imus, ImuSample, imu_counts
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.random_skin import random_skin
from pretouch.sim.scene import SceneSpec
from pretouch.text_table import TextTable
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray
from pretouch_lab.bench.avoidance_scenes import arm as arm_named
from pretouch_lab.run import Cell, Row
from pretouch_lab.table import Column, grouped, table

_PARTS = {"position": slice(3, 6), "orientation": slice(0, 3), "pose": slice(0, 6)}
"""Slices of the error of a pose: rotation vector, then position."""
NOT_FOUND: Row = {
    "position_error_m": None,
    "orientation_error_deg": None,
    "position_sigma_m": None,
    "orientation_sigma_deg": None,
    "nees_position": None,
    "nees_orientation": None,
    "nees_pose": None,
    "clock_error_s": None,
    "link_found": False,
}
"""Row of a unit without a result, or with a result on another link."""
DATA_SHEET = ImuParams(misalignment_deg=0.0)
"""Errors of the sensors. A board glued on at an angle turns the IMU's frame, which no IMU can measure."""
CLOCK_ERROR_S = 0.02
"""Largest offset of a unit's clock [s]."""


def trial(arm: str, plan: Plan, cell: Cell, seed: int) -> Row:
    """Calibrate a random skin in simulation; return a row for each unit, and the computing time [s].

    Each skin has one unit on each link from the second on; the seed draws skin, arm and sensors.
    """
    model = arm_named(arm)
    skin = random_skin(model, seed)
    data = simulate(model, skin, plan, seed, links_known=not cell["find_links"])
    begin = perf_counter()
    answers = calibrate(model, data).units
    took = perf_counter() - begin
    units = [
        {"unit": unit.id, "link": unit.link, "accepted": answer.accepted}
        | (place_row(model, unit, answer.place, late) if answer.place else NOT_FOUND)
        for unit, answer, late in zip(skin.units, answers, clock_errors(len(skin), seed).tolist(), strict=True)
    ]
    return {"units": units, "compute_s": took}


def place_row(model: RobotModel, unit: SensorUnit, place: Place, late: float) -> Row:
    """Compare a calibration's answer with the truth.

    Args:
        model: the arm.
        unit: the unit at its true place.
        place: the result. A link fixed to the true link counts as the true one: no motion can separate them.
        late: true delay of the unit's stamps [s].

    Returns:
        Errors, standard deviations, and errors squared over the covariance (NEES). A correct covariance has means
        of NEES equal to the dimensions: 3 for the position, 3 for the orientation, 6 for both.
    """
    true, answered = (model.link_index(name) for name in (unit.link, place.link))
    if not np.array_equal(model.moved_by[true], model.moved_by[answered]):
        return NOT_FOUND
    T, covariance = seen_from(model, true, answered, place.T_link_sensor, place.covariance)
    turn = Rotation.from_matrix(T[:3, :3].T @ unit.T_link_sensor[:3, :3]).as_rotvec()
    error = np.concatenate([turn, unit.T_link_sensor[:3, 3] - T[:3, 3]])
    nees = {name: float(error[p] @ np.linalg.solve(covariance[p, p], error[p])) for name, p in _PARTS.items()}
    return {
        "position_error_m": float(np.linalg.norm(error[_PARTS["position"]])),
        "orientation_error_deg": float(np.degrees(np.linalg.norm(turn))),
        "position_sigma_m": place.position_sigma,
        "orientation_sigma_deg": float(np.degrees(place.orientation_sigma)),
        **{f"nees_{name}": value for name, value in nees.items()},
        "clock_error_s": place.clock_offset - late,
        "link_found": True,
    }


def simulate(
    model: RobotModel,
    skin: Skin,
    plan: Plan,
    seed: int,
    imu: ImuParams = DATA_SHEET,
    clock_error_s: float = CLOCK_ERROR_S,
    links_known: bool = True,
) -> CalibrationData:
    """Simulate an arm that follows a plan; stamps count from the start of the plan.

    The seed draws errors of arm, sensors and clocks, and all noise.
    """
    plant = Plant(model, SceneSpec(), PlantParams(), plan.start, seed)
    samples: list[ImuSample] = []
    Imus(plant, skin, imu, seed, samples.append)
    joints, begin = _followed(plant, model, plan)
    number, time = (np.array([getattr(sample, name) for sample in samples]) for name in ("unit", "time"))
    values = np.array([sample.counts for sample in samples]).reshape(-1, 6) * imu_counts(imu)
    largest, late = LARGEST_COUNT * imu_counts(imu), clock_errors(len(skin), seed, clock_error_s) - begin
    units = []
    for k, unit in enumerate(skin.units):
        own = number == k
        trace = ImuTrace(time[own] + late[k], values[own, 3:], values[own, :3])
        units.append(UnitData(unit.id, trace, unit.link if links_known else None, float(largest[3]), float(largest[0])))
    return CalibrationData(JointTrace(joints.stamp - begin, joints.q), tuple(units))


def _followed(plant: Plant, model: RobotModel, plan: Plan) -> tuple[JointTrace, float]:
    """Let an arm follow a plan; return the measured joint positions, and the start [s]."""
    controller = plan_controller(model, plan.start)
    commander = PlanCommander(controller, plan, lambda: plant.time)
    states: list[tuple[float, FloatArray]] = []

    class JointRecorder:
        def record(self, cycle: Cycle) -> None:
            if commander.begin is not None:
                states.append((cycle.inputs.robot.stamp, np.array(cycle.inputs.robot.q)))

    clock = PlantClock(plant, controller.limits.period)
    run(controller, plant, NoUnits(), clock, JointRecorder(), commander.done, Options(desired=commander))
    if commander.stopped or commander.begin is None:
        raise ExperimentError(f"The simulated arm did not follow the plan to its end. {commander.stopped}")
    return JointTrace(np.array([stamp for stamp, _ in states]), np.array([q for _, q in states])), commander.begin


def clock_errors(count: int, seed: int, most: float = CLOCK_ERROR_S) -> FloatArray:
    """Draw the delays (K,) [s] of the stamps of `count` units."""
    return np.random.default_rng([seed, 12]).uniform(-most, most, count)


_COLUMNS = (
    Column("link", "link"),
    Column("found", "found", of="units"),
    Column("place\n[mm]", "position_error_m", 2, 1000.0),
    Column("most\n[mm]", "position_error_m_most", 2, 1000.0),
    Column("sigma\n[mm]", "position_sigma_m", 2, 1000.0),
    Column("turn\n[deg]", "orientation_error_deg", 3),
    Column("most\n[deg]", "orientation_error_deg_most", 3),
    Column("sigma\n[deg]", "orientation_sigma_deg", 3),
    Column("NEES\nplace", "nees_position_mean", 1),
    Column("NEES\nturn", "nees_orientation_mean", 1),
    Column("NEES\nboth", "nees_pose_mean", 1),
    Column("clock\n[ms]", "clock_error_s", 2, 1000.0),
)


def tables(rows: Sequence[Row], motion_s: float) -> list[TextTable]:
    """Return a table of errors and their stated deviations after a motion of `motion_s` seconds."""
    units = [unit for row in rows for unit in row["units"]]
    links = [(key["link"], some) for key, some in grouped(units, ("link",))]
    note = (
        "Medians; NEES, the error squared over its covariance, are means: 3, 3 and 6 for a correct covariance. Sigma:"
        " in the worst direction. Clock: error of the estimated offset; true offsets are up to 20 ms. The computation"
        f" takes {np.median([row['compute_s'] for row in rows]):.1f} s a skin. Sensor errors are the data sheet's,"
        " without the angle of a glued board, which no IMU can measure."
    )
    title = (
        f"Calibrated places after {motion_s:.0f} s of motion: {len(links)} units on each of {len(rows)} random skins"
    )
    return [table(title, _COLUMNS, [_errors(name, some) for name, some in (*links, ("all", units))], note)]


def _errors(name: str, units: list[Row]) -> Row:
    """Median, largest and mean size of each number of some units; None without values."""
    row: Row = {"link": name, "units": len(units), "found": sum(unit["link_found"] for unit in units)}
    for key in NOT_FOUND:
        values = np.abs([unit[key] for unit in units if unit[key] is not None])
        for suffix, of in (("", np.median), ("_most", np.max), ("_mean", np.mean)):
            row[f"{key}{suffix}"] = float(of(values)) if len(values) else None
    return row
