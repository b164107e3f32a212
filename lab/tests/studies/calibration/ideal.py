"""What joints and IMUs without any error measure, by finite differences of where each sensor is."""

import numpy as np

from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.traces import ImuTrace, JointTrace

G = np.array([0.0, 0.0, 9.80665])
H = 1e-4
"""Step of the differences [s]."""


def ideal_data(model: RobotModel, skin: Skin, motion, rate: float = 200.0) -> CalibrationData:
    """Sample a motion (`at`, `duration`) at a rate [Hz], joints and all units at the same instants."""
    stamp = np.arange(0.0, motion.duration + 0.5, 1 / rate)
    postures = [[motion.at(t + h)[0] for h in (-H, 0.0, H)] for t in stamp]
    kin = [[model.kinematics(q) for q in three] for three in postures]
    units = []
    for unit, link in zip(skin.units, skin.link, strict=True):
        R = np.array([[k.rotation[link] @ unit.T_link_sensor[:3, :3] for k in three] for three in kin])
        p = np.array(
            [[k.position[link] + k.rotation[link] @ unit.T_link_sensor[:3, 3] for k in three] for three in kin]
        )
        felt = (p[:, 2] - 2 * p[:, 1] + p[:, 0]) / H**2 + G
        turning = R[:, 1].swapaxes(1, 2) @ (R[:, 2] - R[:, 0]) / (2 * H)
        w = np.column_stack([turning[:, 2, 1], turning[:, 0, 2], turning[:, 1, 0]])
        units.append(UnitData(unit.id, ImuTrace(stamp, np.einsum("nji,nj->ni", R[:, 1], felt), w), unit.link))
    return CalibrationData(JointTrace(stamp, np.array([three[1] for three in postures])), tuple(units))
