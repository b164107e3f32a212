"""What an arm is going to do, said before it does it."""

import numpy as np

from pretouch.calibration.motion.plan import Plan
from pretouch.controller import Controller

_PLACES = 200


def announcement(controller: Controller, seconds: float, way: Plan | None) -> tuple[str, ...]:
    """Say in sentences what the arm will do.

    Args:
        controller: that is going to move it.
        seconds: how long it will [s]; infinite until it is stopped.
        way: the way to the start of its path, if it goes there first.
    """
    path, profile = controller.path, controller.profile
    points = np.array([path.point(phase) for phase in np.linspace(0.0, path.length, _PLACES)])
    low, high = points.min(axis=0), points.max(axis=0)
    room = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
    said = []
    if way is not None:
        said.append(
            f"First the arm goes slowly, straight in joint space, to where its path begins: {way.duration:.0f} s. It"
            " does not avoid anybody on this way, and stops where it is pushed."
        )
    still = bool(np.all(high - low < 1e-3))
    said.append(
        f"The arm keeps its end-effector at ({', '.join(f'{v:.2f}' for v in low)}) m (base frame)."
        if still
        else f"The arm moves its end-effector at up to {profile.task.speed_m_s:g} m/s within {room} m (base frame); the"
        " arm itself needs more room."
    )
    said.append(profile.react.announced(profile.task.control_period_s))
    said.append(f"It goes on for {seconds:g} s." if np.isfinite(seconds) else "It goes on until it is stopped.")
    said.append(
        "To stop it: the user stop at once, in any case; Ctrl-C brings it to rest within its limits and ends the run."
    )
    return tuple(said)
