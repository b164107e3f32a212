"""Differences of the simulated arm from its model, and errors of its sensors: values of real Pandas."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive, is_number
from pretouch.errors import ParameterError
from pretouch.robot.description import RobotDescription, panda

Joints = tuple[float, ...]


@dataclass(frozen=True)
class PlantParams(Checked):
    """One kind of simulated arm; a seed makes one arm of it. Tuples hold one value a joint."""

    period_s: Positive = 0.001
    """Physics, joint control and observer period [s]."""
    stiffness_nm_rad: Joints = (3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0)
    """Joint impedance that realises the velocity interface [Nm/rad] (libfranka examples)."""
    damping_ratio: Positive = 1.0
    """Damping of that impedance as a fraction of critical for each joint's own inertia."""
    armature_kg_m2: Positive = 0.1
    """Rotor inertia at the joint [kg m^2] (model data of this package)."""
    mass_error: Fraction = 0.04
    """Link masses and inertias are off by up to this fraction, uniformly (realistic; 0.15 is a stress case)."""
    payload_max_kg: NonNegative = 0.1
    """Unknown mass at the TCP, uniform from 0 [kg] (realistic; 0.5 is a stress case)."""
    friction_f1_nm: Joints = (0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489)
    """Joint friction F1 / (1 + exp(-F2 (qd + F3))) - F1 / (1 + exp(-F2 F3)) [Nm], identified by Gaz et al. 2019."""
    friction_f2_s_rad: Joints = (5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336)
    """F2 [s/rad]."""
    friction_f3_rad_s: Joints = (0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526)
    """F3 [rad/s]."""
    friction_compensated: Fraction = 0.2
    """Part of the friction that the robot's interface knows and subtracts."""
    torque_noise_nm: Joints = (0.26, 0.36, 0.23, 0.35, 0.05, 0.06, 0.01)
    """Standard deviation of the torque sensors' noise [Nm], logged on a real Panda between 10 and 80 Hz."""
    torque_noise_hz: Positive = 80.0
    """Corner frequency of that noise [Hz]."""
    torque_offset_nm: Joints = (0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 0.05)
    """Constant error of each torque sensor, uniform up to this [Nm], logged on a real Panda."""
    ripple_nm: Joints = (0.20, 0.21, 0.07, 0.15, 0.015, 0.015, 0.015)
    """Amplitude of the gear ripple in the torque sensors [Nm], logged on a real Panda."""
    ripple_cycles: Joints = (241.0, 241.0, 241.0, 241.0, 160.0, 160.0, 160.0)
    """Ripple cycles in a turn of the joint."""
    velocity_noise_rad_s: NonNegative = 0.008
    """Standard deviation of the measured joint velocities' noise [rad/s], logged on a real Panda."""
    observer_gain_1_s: Positive = 60.0
    """Gain of the robot's momentum observer [1/s]: about 10 Hz, as the vendor's estimate."""
    wrench_damping: NonNegative = 0.01
    """Damping of the least squares that turn joint torques into a wrench."""
    singular_value_min: NonNegative = 0.02
    """Smallest singular value of the Jacobian at which the robot still gives a wrench."""
    set_point_hz: Annotated[float, Check(low=0.0, open_low=True)] = 100.0
    """Low-pass on the velocity set-points, the vendor's default cut-off [Hz]."""
    state_delay_s: NonNegative = 0.0
    """Age of the state that the interface reports [s], in whole physics steps; its stamp says so."""
    command_delay_s: NonNegative = 0.0
    """Time from a command to when the arm takes it [s], in whole physics steps."""
    bristle_nm: NonNegative = 0.0
    """Friction of each joint that remembers how it came to be where it is (`sim.physics`), where the joint slides fast
    [Nm]; 0: none."""
    bristle_rad: Positive = 0.002
    """Angle over which that friction turns round [rad]: the presliding displacement."""
    stribeck: NonNegative = 0.0
    """Relative increase where the joint barely slides [1]."""
    stribeck_rad_s: Positive = 0.05
    """Speed at which that has gone [rad/s]."""
    load_friction: NonNegative = 0.0
    """Increase of a joint's friction with its torque [1]."""
    cold_friction: NonNegative = 0.0
    """Relative increase of friction in a cold arm [1]."""
    warm_up_s: Positive = 900.0
    """Time constant with which an arm warms up [s]."""
    cogging: NonNegative = 0.0
    """Amplitude with which a gear itself shakes the arm, which the sensors measure, times `ripple_nm` [1]."""
    ring_hz: NonNegative = 0.0
    """Frequency at which the links ring on the joints' springs, which the torque sensors measure and the encoders do
    not see [Hz]; 0: rigid joints."""
    ring_damping: Annotated[float, Check(low=0.0, high=1.0, open_low=True)] = 0.1
    """Damping of that as a fraction of critical."""
    drift_nm: NonNegative = 0.0
    """Standard deviation to which the torque sensors' offsets wander [Nm]."""
    drift_s: Positive = 120.0
    """Time constant of that [s]."""
    cable_n_m: NonNegative = 0.0
    """Stiffness of a cable from a hook above the base to the hand, once it is taut [N/m]; 0: no cable."""
    cable_slack_m: Positive = 0.45
    """Increase over the distance at the ready posture at which it becomes taut [m]."""
    cable_kg: NonNegative = 0.0
    """Part of its mass that hangs at the hand [kg]."""
    cable_friction_n: NonNegative = 0.0
    """Friction along it [N]."""
    stamp_jitter_s: NonNegative = 0.0
    """Largest delay of a state's stamp, uniform [s]."""
    offsets_nm: Joints = ()
    """Constant error of each torque sensor of one known arm [Nm]; none: drawn up to `torque_offset_nm`."""
    ripple_phases_rad: Joints = ()
    """Phase of each joint's ripple, of one known arm [rad]; none: drawn."""
    mass_factors: Joints = ()
    """Factor on mass and inertia of each link, of one known arm, in the order of `RobotModel.links`; none: drawn."""
    payload_kg: NonNegative | None = None
    """The unknown mass at the TCP of one known arm [kg]; None: drawn up to `payload_max_kg`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in (*_SCALED, *_KEPT, *_KNOWN):
            values, low = getattr(self, name), 0.0 if name in _NEVER_BELOW_0 else -np.inf
            if not all(is_number(value) and value >= low for value in values):
                limit = ", none below 0" if low == 0.0 else ""
                raise ParameterError(f"PlantParams.{name} is {values}: give finite numbers{limit}.")

    def check_joints(self, n: int, links: int) -> None:
        """Raise ParameterError unless there is one value for each of n joints, and of what is known of each link."""
        for name in (*_SCALED, *_KEPT, *_KNOWN):
            count, number = len(getattr(self, name)), links if name == "mass_factors" else n
            if count != number and (count or name not in _KNOWN):
                raise ParameterError(
                    f"PlantParams.{name} has {count} values, and {number} are needed: it is of another arm, so take"
                    " plant_params_of(description), or identify this one."
                )


_SCALED = ("friction_f1_nm", "torque_noise_nm", "torque_offset_nm", "ripple_nm")
"""Torques: they grow with the size of a drive."""
_KNOWN = ("offsets_nm", "ripple_phases_rad", "mass_factors")
"""Fields of one known arm, or empty."""
_KEPT = ("stiffness_nm_rad", "friction_f2_s_rad", "friction_f3_rad_s", "ripple_cycles")
_NEVER_BELOW_0 = ("mass_factors", "stiffness_nm_rad", "torque_noise_nm")


def plant_params_of(arm: RobotDescription) -> PlantParams:
    """Return figures for an arm of any number of joints, from the Panda's: assumptions, measured on no such arm.

    Each joint takes the figures of the Panda's joint at the same place between base and hand. Torques of friction,
    noise, offset and ripple are scaled by the ratio of the two joints' torque limits; all else is kept. An arm with as
    many joints as the Panda and its torque limits, such as the FR3, so has the Panda's own.
    """
    model, n = panda(), len(arm.q_ready)
    place = np.rint(np.linspace(0, len(model.q_ready) - 1, n)).astype(np.int64)
    size = arm.tau_max / model.tau_max[place]
    own = PlantParams()
    figures: dict[str, Any] = {
        name: tuple((np.array(getattr(own, name))[place] * (size if name in _SCALED else 1.0)).tolist())
        for name in (*_SCALED, *_KEPT)
    }
    return replace(own, **figures)


def assumed_plant(arm: RobotDescription) -> str:
    """Say what `plant_params_of` makes of an arm."""
    if plant_params_of(arm) == PlantParams():
        return f"The joints of the simulated {arm.name} are those of a Panda."
    return (
        f"Joint stiffness, rotor inertia, friction, noise and offsets of the simulated {arm.name} are the Panda's, its"
        " torques scaled by torque limits: none was measured on this arm. Compare profiles, not arms."
    )
