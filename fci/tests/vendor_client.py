"""A program as anyone would write it with the vendor's library: `vendor_client.py KIND HOST WHAT VALUES...`.

Prints what came of it as JSON. A process of its own: the libraries hold the interpreter, and cannot share a process.
"""

import json
import math
import os
import sys


def _connected(kind, host):
    """The library, and the robot by it."""
    global kept
    if kind == "fr3":
        import pylibfranka as lib

        return lib, lib.Robot(host, lib.RealtimeConfig.kIgnore)
    import panda_py
    from panda_py import libfranka as lib

    if kind == "panda":
        return lib, lib.Robot(host)
    kept = panda_py.Panda(host)
    return lib, kept.get_robot()


_FIELDS = (
    "O_T_EE", "O_T_EE_d", "F_T_EE", "EE_T_K", "m_ee", "F_x_Cee", "m_load", "F_x_Cload", "I_load", "elbow", "tau_J",
    "tau_J_d", "q", "q_d", "dq", "dq_d", "ddq_d", "joint_contact", "cartesian_contact", "joint_collision",
    "cartesian_collision", "tau_ext_hat_filtered", "O_F_ext_hat_K", "K_F_ext_hat_K", "theta", "dtheta",
    "control_command_success_rate",
)  # fmt: skip


def _told(state):
    """All that a state tells."""
    values = {name: getattr(state, name) for name in _FIELDS}
    told = {k: list(map(float, v)) if hasattr(v, "__iter__") else float(v) for k, v in values.items()}
    mode, time = str(state.robot_mode).rpartition(".")[2], state.time.to_sec()
    errors = {name: getattr(state, name) for name in ("current_errors", "last_motion_errors")}
    errors = {k: sorted(n for n in dir(v) if n[0] != "_" and getattr(v, n) is True) for k, v in errors.items()}
    return {"mode": mode.removeprefix("k").lower(), "time": time, **errors, **told}


def _fresh(robot):
    """A state sent after the last request was answered: the first that is read may have been on its way before."""
    robot.read_once()
    return _told(robot.read_once())


_COMMANDS = {
    "joint_velocity": "JointVelocities", "joint_position": "JointPositions",
    "cartesian_velocity": "CartesianVelocities", "cartesian_pose": "CartesianPose", "torque": "Torques",
}  # fmt: skip


def _behavior(robot, kind, torque, force):
    """Set the upper thresholds, and half of them as the lower ones."""
    torques, forces = ([0.5 * torque] * 7, [torque] * 7), ([0.5 * force] * 6, [force] * 6)
    if kind == "panda":
        robot.set_collision_behavior(*torques, *torques, *forces, *forces)
    else:
        robot.set_collision_behavior(*torques, *forces)


def _ran(lib, robot, kind, seconds, command, what="joint_velocity", force=90.0, limited=False):
    """Run a motion by `command(state, time)`, with a collision threshold [N], recover, and tell all that was told."""
    _behavior(robot, kind, 90.0, force)
    told, time, error, alone = [], 0.0, None, what == "torque"

    def answer(state, duration):
        nonlocal time
        told.append(_told(state))
        time += duration.to_sec()
        answered = getattr(lib, _COMMANDS[what])(command(state, time))
        answered.motion_finished = time >= seconds
        return answered

    try:
        if hasattr(robot, "control"):
            begin = robot.control if alone else getattr(robot, f"control_{what}")
            begin(answer, *(() if alone else (lib.ControllerMode.kJointImpedance,)), limited, 1000.0)
        else:
            mode = () if alone else (lib.ControllerMode.JointImpedance,)
            control = getattr(robot, f"start_{what}_control")(*mode)
            while time < seconds:
                control.writeOnce(answer(*control.readOnce()))
    except Exception as why:
        error = str(why)
    after = _fresh(robot)
    robot.automatic_error_recovery()
    return {"error": error, "told": told, "after": after, "recovered": _fresh(robot)}


def state(lib, robot, kind):
    return _told(robot.read_once())


def _share(time, seconds):
    """Share of its way of a motion from rest to rest."""
    share = min(time / seconds, 1.0)
    return share - math.sin(2 * math.pi * share) / (2 * math.pi)


def move(lib, robot, kind, seconds, jump=0.0):
    """Move there and back to rest; with a jump of the velocity [rad/s] in the middle."""

    def command(state, time):
        speed = 0.2 * math.sin(math.pi * min(time / seconds, 1.0)) ** 2 + (jump if time > seconds / 2 else 0.0)
        return [speed, -speed / 2, speed, 0.0, 0.0, speed, -speed]

    return _ran(lib, robot, kind, seconds, command)


def positions(lib, robot, kind, seconds):
    """Move each joint by 0.1 rad through its positions."""
    begun = _fresh(robot)["q_d"]

    def command(state, time):
        return [q + 0.1 * _share(time, seconds) for q in begun]

    return _ran(lib, robot, kind, seconds, command, "joint_position")


def cartesian(lib, robot, kind, seconds):
    """Move the end-effector by 0.1 m along y by velocities and back by poses."""

    def by_velocity(state, time):
        share = min(time / seconds, 1.0)
        return [0.0, 0.1 / seconds * (1 - math.cos(2 * math.pi * share)), 0.0, 0.0, 0.0, 0.0]

    def by_pose(state, time):
        return [*there[:13], there[13] - 0.1 * _share(time, seconds), *there[14:]]

    by_velocities = _ran(lib, robot, kind, seconds, by_velocity, "cartesian_velocity", limited=True)
    there = _fresh(robot)["O_T_EE_d"]
    return [by_velocities, _ran(lib, robot, kind, seconds, by_pose, "cartesian_pose")]


def hold(lib, robot, kind, seconds, force):
    """Stand still in a motion, with a collision threshold [N]."""
    return _ran(lib, robot, kind, seconds, lambda state, time: [0.0] * 7, force=force)


def torques(lib, robot, kind, seconds):
    """Hold the arm by springs and dampers of one's own, within the limit of the torque's rate."""
    begun = list(robot.read_once().q)

    def command(state, time):
        wanted = [600.0 * (q0 - q) - 40.0 * dq for q0, q, dq in zip(begun, state.q, state.dq, strict=True)]
        return [max(-1.0, min(1.0, w - last)) + last for w, last in zip(wanted, state.tau_J_d, strict=True)]

    return {"begun": begun, **_ran(lib, robot, kind, seconds, command, "torque")}


def settings(lib, robot, kind):
    """Set all that can be set, and read what can be read of it."""
    turned = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.01, 0.02, 0.03, 1.0]
    robot.set_joint_impedance([1000.0] * 7)
    robot.set_cartesian_impedance([500.0] * 3 + [50.0] * 3)
    robot.set_load(0.5, [0.0, 0.01, 0.02], [1e-3, 0.0, 0.0, 0.0, 2e-3, 0.0, 0.0, 0.0, 3e-3])
    (robot.set_ee if kind == "panda" else robot.set_EE)(turned)
    (robot.set_k if kind == "panda" else robot.set_K)(turned)
    if kind == "panda":
        robot.set_guiding_mode([True] * 6, False)
    refused = {
        "load": _error(lambda: robot.set_load(-1.0, [0.0] * 3, [0.0] * 9)),
        "collision": _error(lambda: _behavior(robot, kind, -1.0, 1.0)),
    }
    return {"state": _fresh(robot), "refused": refused, "turned": turned}


def _error(do):
    try:
        do()
    except Exception as error:
        return str(error)
    return ""


def model(lib, robot, kind):
    """What the library computes with the model it was given."""
    made, state = robot.load_model(), robot.read_once()
    jacobian = made.zero_jacobian(state) if kind == "fr3" else made.zero_jacobian(lib.Frame.kEndEffector, state)
    return {
        "q": list(state.q), "jacobian": list(map(float, _flat(jacobian))),
        "gravity": list(made.gravity(state)), "mass": list(map(float, _flat(made.mass(state)))),
    }  # fmt: skip


def panda_python(lib, robot, kind):
    """Let panda-python plan and control motions, by torques: to a posture, then 0.05 m up."""
    begun = list(kept.q)
    done = [kept.move_to_joint_position([q + 0.1 for q in begun])]
    posture, pose = list(kept.q), kept.get_pose()
    pose[2, 3] += 0.05
    done.append(kept.move_to_pose(pose))
    return {"done": done, "begun": begun, "posture": posture, "off": (kept.get_pose() - pose)[:3, 3].tolist()}


def _flat(matrix):
    import numpy as np

    return np.array(matrix).reshape(-1, order="F")


def gripper(lib, robot, kind):
    """Home, grasp, close further, open, grasp something narrower, stop; then what fails, and a second client."""
    hand = lib.Gripper(sys.argv[2])
    told = [hand.read_once()]
    results = []
    for what, *values in (
        ("homing",), ("grasp", 0.041, 0.1, 20.0), ("move", 0.01, 0.1), ("move", 0.08, 0.1), ("grasp", 0.03, 0.1, 20.0),
        ("stop",),
    ):  # fmt: skip
        results.append(getattr(hand, what)(*values))
        told.append(hand.read_once())
    first, *after = told
    return {
        "first": [first.width, first.max_width, first.is_grasped, first.temperature], "results": results,
        "widths": [one.width for one in after], "grasped": [one.is_grasped for one in after],
        "failed": _error(lambda: hand.move(0.2, 0.1)), "second": _error(lambda: lib.Gripper(sys.argv[2])),
    }  # fmt: skip


def main():
    kind, host, what, *values = sys.argv[1:]
    try:
        lib, robot = _connected(kind, host)
    except Exception as error:
        print(json.dumps({"error": str(error)}), flush=True)
    else:
        known = (state, move, positions, cartesian, torques, hold, settings, model, gripper, panda_python)
        done = {f.__name__: f for f in known}[what](lib, robot, kind, *map(float, values))
        print(json.dumps(done), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
