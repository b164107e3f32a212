"""Data of a calibration without a plant: an arm that moves by sines, and IMUs by finite differences of their places."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.calibration.values import CalibrationData, UnitData
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.traces import ImuTrace, JointTrace

UP = np.array([0.0, 0.0, 9.81])
H = 1e-4
"""Step of the differences [s]."""
RATE_HZ = 208.0


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of what is wrong with sensors; all of it is 0 in exact data."""

    acceleration: float = 0.015
    angular_velocity: float = 0.002
    acceleration_bias: float = 0.3
    angular_velocity_bias: float = 0.05
    scale: float = 0.008
    joints: float = 3e-5


EXACT = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


SWINGS = (0.5, 0.35, 0.5, 0.4, 0.7, 0.6, 0.9)


class MovingArm:
    """An arm whose joints swing, each by two sines of its amplitude [rad]; `stand`: those that do not."""

    def __init__(
        self, model: RobotModel, duration: float = 45.0, stand: tuple[int, ...] = (), swings: tuple[float, ...] = SWINGS
    ) -> None:
        self.model = model
        self.time = np.arange(0.0, duration, 1 / RATE_HZ)
        self._amplitude = np.array(swings)
        self._amplitude[list(stand)] = 0.0
        instants = self.time[:, None] + np.array([-H, 0.0, H])
        self.q = self._at(self.time)
        postures = [model.kinematics(q) for q in self._at(instants.ravel())]
        self._position = np.array([k.position for k in postures]).reshape(len(self.time), 3, -1, 3)
        self._rotation = np.array([k.rotation for k in postures]).reshape(len(self.time), 3, -1, 3, 3)

    def _at(self, time: np.ndarray) -> np.ndarray:
        w = 2 * np.pi * np.array([0.21, 0.27, 0.33, 0.31, 0.43, 0.47, 0.55])
        t = time[:, None]
        return self.model.description.q_ready + self._amplitude * (np.sin(w * t) + 0.3 * np.sin(2.7 * w * t + 1.0))

    def joints(self, noise: Noise = EXACT, seed: int = 0) -> JointTrace:
        return JointTrace(self.time, self.q + noise.joints * np.random.default_rng(seed).standard_normal(self.q.shape))

    def imu(self, unit: SensorUnit) -> ImuTrace:
        """What an IMU without any error measures."""
        link = self.model.link_index(unit.link)
        R = self._rotation[:, :, link] @ unit.T_link_sensor[:3, :3]
        p = self._position[:, :, link] + self._rotation[:, :, link] @ unit.T_link_sensor[:3, 3]
        felt = (p[:, 2] - 2 * p[:, 1] + p[:, 0]) / H**2 + UP
        turned = R[:, 1].swapaxes(1, 2) @ (R[:, 2] - R[:, 0]) / (2 * H)
        w = np.column_stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]])
        return ImuTrace(self.time, np.einsum("nji,nj->ni", R[:, 1], felt), w)

    def data(self, skin: Skin, seed: int = 0, noise: Noise = Noise(), links_known: bool = True) -> CalibrationData:
        """What joints and units measure; units whose ids agree have the same errors."""
        units = []
        for unit in skin.units:
            rng = np.random.default_rng([seed, *unit.id.encode()])
            exact = self.imu(unit)
            late = 0.02 * rng.uniform(-1, 1) * bool(noise.joints)
            felt = _measured(exact.acceleration, noise.acceleration, noise.acceleration_bias, noise.scale, rng)
            w = _measured(exact.angular_velocity, noise.angular_velocity, noise.angular_velocity_bias, noise.scale, rng)
            link = unit.link if links_known else None
            units.append(UnitData(unit.id, ImuTrace(exact.stamp + late, felt, w), link))
        return CalibrationData(self.joints(noise, seed), tuple(units))


def _measured(exact: np.ndarray, noise: float, bias: float, scale: float, rng: np.random.Generator) -> np.ndarray:
    factor = 1 + scale * rng.standard_normal(3)
    return factor * exact + bias * rng.standard_normal(3) + noise * rng.standard_normal(exact.shape)


def turned(unit: SensorUnit, angle: np.ndarray, shift: np.ndarray) -> SensorUnit:
    """The same unit elsewhere: turned by a rotation vector in its frame [rad], moved in the link's [m]."""
    T = unit.T_link_sensor.copy()
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(angle).as_matrix()
    T[:3, 3] += shift
    return SensorUnit(unit.id, unit.link, T)


def pose_error(true: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Error (6,): rotation vector in the sensor frame [rad], position in the link frame [m]."""
    turn = Rotation.from_matrix(found[:3, :3].T @ true[:3, :3]).as_rotvec()
    return np.concatenate([turn, true[:3, 3] - found[:3, 3]])
