"""A scripted approach to one electrode in simulation: what comes near, along the axis and beside it."""

import mujoco
import numpy as np

from pretouch.sensing.sensor import Capacitive
from pretouch.sim.capacitive import DRIFT, NOISE, electrode_on, field
from pretouch.sim.rays import geoms_of
from pretouch.types import FloatArray

THINGS = {
    "fist": '<geom type="sphere" size="0.05"/>',
    "forearm": '<geom type="capsule" size="0.04" fromto="-0.12 0 0 0.12 0 0"/>',
    "flat hand": '<geom type="box" size="0.09 0.045 0.012"/>',
    "finger": '<geom type="capsule" size="0.009" fromto="-0.04 0 0 0.04 0 0"/>',
}
"""What approaches: a fist, a forearm across, a flat hand, a finger across."""
_ASIDE_DEG = (0.0, 30.0)
_START_M, _STEP_M = 0.45, 0.002
_ELECTRODE_M = 0.001
"""Radius of the ball that stands for the electrode, for distances [m]."""


def simulated_approach(sensor: Capacitive, seed: int) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return distances (N,) [m] between electrode and surface, signals (N,), and what came, along each line."""
    rng, rows, names = np.random.default_rng([seed, 65]), list[tuple[float, float]](), list[str]()
    for name, geom in THINGS.items():
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><body name="electrode"><geom size="{_ELECTRODE_M}"/></body>'
            f'<body name="thing" mocap="true">{geom}</body></worldbody></mujoco>'
        )
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        electrode, geoms = electrode_on(sensor, model.body("electrode").id, np.eye(4)), geoms_of(model, data)
        for aside in np.deg2rad(_ASIDE_DEG):
            line, drift = np.array([0.0, np.sin(aside), np.cos(aside)]), DRIFT * rng.standard_normal()
            for away in np.arange(_START_M, 0.0, -_STEP_M):
                data.mocap_pos[0] = away * line
                mujoco.mj_kinematics(model, data)
                distance = mujoco.mj_geomDistance(model, data, 0, 1, 2 * _START_M, None) + _ELECTRODE_M
                if distance <= _ELECTRODE_M:
                    break
                clean = field(electrode, data.xpos, data.xmat, geoms, 2 * _START_M)
                rows.append((distance, clean + drift + NOISE * rng.standard_normal()))
                names.append(name)
    table = np.array(rows)
    return table[:, 0], table[:, 1], names
