"""The state datagram: what a client is told each millisecond. External forces have the vendor's sign, minus ours."""

from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.arm import ServedArm
from pretouch_fci.frames import pose
from pretouch_fci.wire import ERRORS, ControllerMode, Protocol

_STILL = np.zeros(7)


class StateDatagram:
    """One datagram, written again and again."""

    def __init__(self, protocol: Protocol, arm: ServedArm) -> None:
        self._arm, self._state = arm, np.zeros((), protocol.state)
        # views taken once: looking a field up costs more than writing it
        self._to: dict[str, Any] = {name: self._state[name] for name in protocol.state.names or ()}
        self._to["O_ddP_O"][:] = arm.model.gravity
        self.frames_changed()

    def frames_changed(self) -> None:
        """Write frames and loads anew."""
        to, f = self._to, self._arm.frames
        for name, T in (("F_T_EE", f.F_T_EE), ("EE_T_K", f.EE_T_K), ("F_T_NE", f.F_T_NE), ("NE_T_EE", f.NE_T_EE)):
            to[name][:] = _columns(T)
        for suffix, body in (("ee", f.hand), ("load", f.load)):
            to[f"m_{suffix}"][...] = body.mass
            to[f"F_x_C{suffix}"][:], to[f"I_{suffix}"][:] = body.com, _columns(body.inertia)

    def write(self, message_id: int) -> bytes:
        """Return the state of the arm as the datagram of a millisecond."""
        to, arm = self._to, self._arm
        to["message_id"][...] = message_id
        self._write_joints()
        self._write_poses()
        motion = arm.motion
        to["motion_generator_mode"][...] = 0 if motion is None else motion.kind.generator + 1
        to["controller_mode"][...] = ControllerMode.NONE if motion is None else motion.controller
        to["robot_mode"][...] = arm.mode
        to["control_command_success_rate"][...] = arm.success_rate
        for name, errors in (("errors", arm.errors), ("reflex_reason", arm.reflex_reason)):
            to[name][:] = 0
            for error in errors:
                to[name][ERRORS.index(error)] = 1
        return self._state.tobytes()

    def _write_joints(self) -> None:
        to, arm, report = self._to, self._arm, self._arm.report
        to["q"][:] = to["theta"][:] = report.q
        to["dq"][:] = to["dtheta"][:] = report.qd
        to["q_d"][:], to["dq_d"][:], to["ddq_d"][:] = report.q_commanded, arm.qd, arm.qdd
        to["tau_J"][:], to["tau_J_d"][:], to["dtau_J"][:] = arm.torques.measured, arm.torques.desired, arm.torques.rate
        to["tau_ext_hat_filtered"][:] = 0.0 - report.tau_ext
        contacts = arm.contacts
        to["joint_contact"][:], to["cartesian_contact"][:] = contacts.joint_contact, contacts.cartesian_contact
        to["joint_collision"][:], to["cartesian_collision"][:] = contacts.joint_collision, contacts.cartesian_collision
        for name, q in (("elbow", report.q), ("elbow_d", report.q_commanded), ("elbow_c", report.q_commanded)):
            to[name][:] = q[2], 1.0 if q[3] >= 0 else -1.0

    def _write_poses(self) -> None:
        to, arm, report = self._to, self._arm, self._arm.report
        F_T_EE, flange = arm.frames.F_T_EE, arm.frames.flange
        desired = arm.model.kinematics(report.q_commanded)
        O_T_EE_d = pose(desired, flange) @ F_T_EE
        to["O_T_EE_d"][:] = to["O_T_EE_c"][:] = _columns(O_T_EE_d)
        twist = arm.model.jacobian(desired, flange, O_T_EE_d[:3, 3]) @ arm.qd
        to["O_dP_EE_d"][:] = twist
        commanded = None if arm.motion is None else arm.motion.kind.commanded
        velocity, rate = (np.append(twist, 0.0), _STILL) if commanded is None else commanded
        to["O_dP_EE_c"][:], to["O_ddP_EE_c"][:] = velocity[:6], rate[:6]
        to["delbow_c"][0], to["ddelbow_c"][0] = velocity[6], rate[6]
        kin = arm.model.kinematics(report.q)
        O_T_EE = pose(kin, flange) @ F_T_EE
        to["O_T_EE"][:] = _columns(O_T_EE)
        if report.wrench is None:
            to["O_F_ext_hat_K"][:] = to["K_F_ext_hat_K"][:] = 0.0
            return
        O_T_K = O_T_EE @ arm.frames.EE_T_K
        wrench = by_robot_at(report.wrench, kin.position[arm.model.ee], O_T_K[:3, 3])
        to["O_F_ext_hat_K"][:] = wrench
        to["K_F_ext_hat_K"][:3], to["K_F_ext_hat_K"][3:] = wrench[:3] @ O_T_K[:3, :3], wrench[3:] @ O_T_K[:3, :3]


def by_robot_at(wrench: FloatArray, at: FloatArray, to: FloatArray) -> FloatArray:
    """Return the wrench (6,) by the robot on its environment about `to` (3,) [m], of one on the robot about `at`."""
    (x, y, z), (fx, fy, fz) = at - to, wrench[:3]
    moment = np.array([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx])
    return np.concatenate([0.0 - wrench[:3], 0.0 - wrench[3:] - moment])


def _columns(matrix: FloatArray) -> FloatArray:
    """Numbers of a matrix, column by column."""
    return matrix.T.reshape(-1)
