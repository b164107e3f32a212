"""The Franka Control Interface on the wire: of the Panda (5), the FR3 (10) and the hand (3). Little endian, packed."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np

from pretouch.types import FloatArray

PORT = 1337
"""TCP port of the interface; the vendor's clients know no other."""
GRIPPER_PORT = 1338
"""That of the hand."""
_BYTE = struct.Struct("<B")
HEADER = struct.Struct("<III")
"""Number of the command, identifier of the request, size of the whole message [B]."""
REQUEST_MOST = 1024
"""No request is longer [B]."""
CONNECT = struct.Struct("<HH")
"""Body of the request to connect: version of the client's library, and its UDP port."""
JOINTS = 7
"""Joints of any arm that speaks it."""

RobotKind = Literal["panda", "fr3"]


class RobotMode(IntEnum):
    """Mode of the robot."""

    OTHER = 0
    IDLE = 1
    MOVE = 2
    GUIDING = 3
    REFLEX = 4
    USER_STOPPED = 5
    RECOVERY = 6


class Generator(IntEnum):
    """Motion generators as a request to move numbers them; a state has one more, and 0 for none."""

    JOINT_POSITION = 0
    JOINT_VELOCITY = 1
    CARTESIAN_POSITION = 2
    CARTESIAN_VELOCITY = 3
    NONE = 4
    """Torques alone; the Panda's protocol has none, its clients send velocities of 0 beside them."""


OF_END_EFFECTOR = (Generator.CARTESIAN_POSITION, Generator.CARTESIAN_VELOCITY)
"""Those that command the end-effector."""


class ControllerMode(IntEnum):
    """Controllers, as requests and states number them."""

    JOINT_IMPEDANCE = 0
    CARTESIAN_IMPEDANCE = 1
    EXTERNAL = 2
    NONE = 3


_ERRORS = """
joint_position_limits_violation cartesian_position_limits_violation self_collision_avoidance_violation
joint_velocity_violation cartesian_velocity_violation force_control_safety_violation joint_reflex cartesian_reflex
max_goal_pose_deviation_violation max_path_pose_deviation_violation cartesian_velocity_profile_safety_violation
joint_position_motion_generator_start_pose_invalid joint_motion_generator_position_limits_violation
joint_motion_generator_velocity_limits_violation joint_motion_generator_velocity_discontinuity
joint_motion_generator_acceleration_discontinuity cartesian_position_motion_generator_start_pose_invalid
cartesian_motion_generator_elbow_limit_violation cartesian_motion_generator_velocity_limits_violation
cartesian_motion_generator_velocity_discontinuity cartesian_motion_generator_acceleration_discontinuity
cartesian_motion_generator_elbow_sign_inconsistent cartesian_motion_generator_start_elbow_invalid
force_controller_desired_force_tolerance_violation start_elbow_sign_inconsistent communication_constraints_violation
power_limit_violation cartesian_motion_generator_joint_position_limits_violation
cartesian_motion_generator_joint_velocity_limits_violation cartesian_motion_generator_joint_velocity_discontinuity
cartesian_motion_generator_joint_acceleration_discontinuity cartesian_position_motion_generator_invalid_frame
controller_torque_discontinuity joint_p2p_insufficient_torque_for_planning tau_j_range_violation instability_detection
joint_move_in_wrong_direction cartesian_spline_violation joint_via_plan_limit_violation
base_acceleration_initialization_timeout base_acceleration_invalid_reading
"""
ERRORS = tuple(_ERRORS.split())
"""Names of the errors, in the order of the flags in a state."""

_STATE = """
message_id:<u8 O_T_EE:16f O_T_EE_d:16f F_T_EE:16f EE_T_K:16f F_T_NE:16f NE_T_EE:16f m_ee:f I_ee:9f F_x_Cee:3f m_load:f
I_load:9f F_x_Cload:3f elbow:2f elbow_d:2f tau_J:7f tau_J_d:7f dtau_J:7f q:7f q_d:7f dq:7f dq_d:7f ddq_d:7f
joint_contact:7f cartesian_contact:6f joint_collision:7f cartesian_collision:6f tau_ext_hat_filtered:7f
O_F_ext_hat_K:6f K_F_ext_hat_K:6f O_dP_EE_d:6f O_ddP_O:3f elbow_c:2f delbow_c:2f ddelbow_c:2f O_T_EE_c:16f
O_dP_EE_c:6f O_ddP_EE_c:6f theta:7f dtheta:7f
"""
_ACCELEROMETERS = "accelerometer_top:(6,3)f accelerometer_bottom:(6,3)f"
_FLAGS = """
motion_generator_mode:u1 controller_mode:u1 errors:41u1 reflex_reason:41u1 robot_mode:u1
control_command_success_rate:f
"""
_COMMAND = """
message_id:<u8 q_c:7<f8 dq_c:7<f8 O_T_EE_c:16<f8 O_dP_EE_c:6<f8 elbow_c:2<f8 valid_elbow:u1
motion_generation_finished:u1 tau_J_d:7<f8
"""
"""Fields of the datagrams as NAME:TYPE, in their order; f is the real number of the protocol."""


def _layout(fields: str, real: str = "<f8") -> np.dtype[np.void]:
    """Return the structured type of a datagram."""
    names_and_types = (field.split(":") for field in fields.split())
    return np.dtype([(name, of.replace("f", real) if "<" not in of else of) for name, of in names_and_types])


MOVE = struct.Struct("<II6d")
"""Begins the body of the request to move: controller, motion generator, and how far the motion may leave its path and
its goal. The FR3's goes on with whether the robot interpolates by itself between few commands, and velocities for it.
"""
_COMMON = {
    "Connect": CONNECT.size,
    "StopMove": 0,
    "SetCollisionBehavior": 8 * 52,
    "SetJointImpedance": 8 * JOINTS,
    "SetCartesianImpedance": 8 * 6,
    "SetGuidingMode": 7,
    "SetEEToK": 8 * 16,
    "SetNEToEE": 8 * 16,
    "SetLoad": 8 * 13,
    "AutomaticErrorRecovery": 0,
}
"""Sizes of the bodies of requests [B] that are the same in both protocols."""


def fastest_of(body: bytes) -> FloatArray | None:
    """Read the largest velocities (7,) [rad/s] of a request to move; None unless the robot is to find the way."""
    rest = body[MOVE.size :]
    return np.frombuffer(rest, "<f8", offset=1) if any(rest[:1]) else None


@dataclass(frozen=True, kw_only=True)
class WireInterface:
    """Requests and their answers, in one version."""

    name: str
    """Name for people."""
    version: int
    """Both sides must have the same."""
    header: struct.Struct = HEADER
    """Begins each message."""
    status: struct.Struct = _BYTE
    """Begins the body of each answer."""
    requests: tuple[str, ...]
    """Names of the requests, by their numbers."""
    sizes: dict[str, int]
    """Sizes of their bodies [B]."""

    def reply(self, name: str, identifier: int, body: bytes) -> bytes:
        """Return the answer to a request."""
        return self.header.pack(self.requests.index(name), identifier, self.header.size + len(body)) + body


@dataclass(frozen=True, kw_only=True)
class Protocol(WireInterface):
    """One version of the interface of the arm."""

    name: str = "FCI"
    kind: RobotKind
    """The robot that speaks it."""
    state: np.dtype[np.void]
    """Datagram from the robot, once each millisecond."""
    command: np.dtype[np.void]
    """Datagram to the robot, in answer to each state of a motion."""
    generators: tuple[Generator, ...]
    """Motion generators that it knows."""
    move: tuple[str, ...]
    """Outcomes of a motion, by the numbers in the answers to the request to move."""


_PANDA_REQUESTS = """
Connect Move StopMove GetCartesianLimit SetCollisionBehavior SetJointImpedance SetCartesianImpedance SetGuidingMode
SetEEToK SetNEToEE SetLoad SetFilters AutomaticErrorRecovery LoadModelLibrary
"""
_PANDA_OUTCOMES = "success,started,preempted,not possible,singular,invalid,reflex,emergency,input error,aborted"
PANDA = Protocol(
    version=5,
    kind="panda",
    state=_layout(_STATE + _FLAGS),
    command=_layout(_COMMAND),
    requests=tuple(_PANDA_REQUESTS.split()),
    sizes={**_COMMON, "Move": MOVE.size, "GetCartesianLimit": 4, "SetFilters": 8 * 5, "LoadModelLibrary": 2},
    generators=tuple(Generator)[: Generator.NONE],
    move=tuple(_PANDA_OUTCOMES.split(",")),
)
"""Panda, libfranka 0.9."""

_FR3_REQUESTS = """
Connect Move StopMove SetCollisionBehavior SetJointImpedance SetCartesianImpedance SetGuidingMode SetEEToK SetNEToEE
SetLoad AutomaticErrorRecovery GetRobotModel
"""
_FR3_OUTCOMES = (
    "success,started,preempted,preempted by safety,rejected by safety,not possible,singular,invalid,reflex,emergency,"
    "input error,aborted"
)
FR3 = Protocol(
    version=10,
    kind="fr3",
    state=_layout(_STATE + _ACCELEROMETERS + _FLAGS, "<f4"),
    command=_layout(_COMMAND + "torque_command_finished:u1"),
    requests=tuple(_FR3_REQUESTS.split()),
    sizes={**_COMMON, "Move": MOVE.size + 1 + 8 * JOINTS, "GetRobotModel": 0},
    generators=tuple(Generator),
    move=tuple(_FR3_OUTCOMES.split(",")),
)
"""FR3, libfranka 0.18 and later."""

GRASP = struct.Struct("<5d")
"""Body of the request to grasp: width [m], tolerances inwards and outwards [m], speed [m/s], force [N]."""
MOVE_FINGERS = struct.Struct("<2d")
"""Body of the request to move the fingers: width [m] and speed [m/s]."""
GRIPPER_STATE = struct.Struct("<Idd?H")
"""Datagram from the hand: its time [ms], width [m], largest width [m], whether it grasps, temperature [deg C]."""
GRIPPER = WireInterface(
    name="the protocol of the hand",
    version=3,
    header=struct.Struct("<HII"),
    status=struct.Struct("<H"),
    requests=("Connect", "Homing", "Grasp", "Move", "Stop"),
    sizes={"Connect": CONNECT.size, "Homing": 0, "Grasp": GRASP.size, "Move": MOVE_FINGERS.size, "Stop": 0},
)
"""Franka Hand, the same with both arms."""

PROTOCOLS: dict[RobotKind, Protocol] = {"panda": PANDA, "fr3": FR3}
