"""An identified arm as a world file in TOML for simulations (`domain_randomisation`), and as a figure."""

from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure

from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_lab.identification.identify import IdentifiedArm

_MOST_POINTS = 4000


def arm_toml(result: IdentifiedArm, model: RobotModel, source: str) -> str:
    """Return the file's text; numbers that were not identified keep their defaults, and comments say so."""
    fitted, noise, usual = result.fit, result.noise, result.usual
    share = 1.0 - usual.friction_compensated
    origin = "".join(c if c.isprintable() and c not in '"\\' else "_" for c in source)
    lines = [
        f'about = "An arm identified from {origin}: {result.seconds:.0f} s of free motion."',
        "",
        f"# friction_compensated stays at {usual.friction_compensated:g}: only friction that is not compensated shows,",
        f"# so friction_f1_nm is that part divided by {share:g}.",
        f"# torque_noise_hz stays at {usual.torque_noise_hz:g}: the observer hides it.",
        "# stiffness, damping, rotor inertia and delays stay unchanged: a residual does not determine them.",
    ]
    for row in result.of_joints():
        values, errors = row.values, row.standard_errors
        if row.field == "friction_f1_nm":
            values, errors = np.maximum(values, 0.0) / share, errors / share
        if row.field:
            unsure = ", ".join(str(j + 1) for j in np.flatnonzero(~row.identified))
            note = f"# joints {unsure}: hardly determined by the recording"
            lines += _field(row.field, _list(values), _list(errors), note if unsure else "")
    masses = next(row for row in result.of_joints() if row.field == "")
    factors, errors = np.ones(len(model.links)), np.zeros(len(model.links))
    for link, moved in enumerate(map(np.flatnonzero, model.moved_by)):
        if len(moved):  # links behind the same joint have the same error
            factors[link], errors[link] = max(1.0 + masses.values[moved[-1]], 0.05), masses.standard_errors[moved[-1]]
    unsure = ", ".join(model.joints[j] for j in np.flatnonzero(~masses.identified))
    note = f"# the links behind {unsure}: hardly changed from the assumption"
    lines += _field("mass_factors", _list(factors), _list(errors), note if unsure else "")
    payload, error = fitted.payload
    lines += _field("payload_kg", f"{max(payload, 0.0):.6g}", f"{error:.3g}")
    if noise is not None:
        lines += _field("velocity_noise_rad_s", f"{noise.velocity_rad_s:.6g}", f"{noise.velocity_error_rad_s:.3g}")
        lines += _field("observer_gain_1_s", f"{fitted.gain:.6g}", f"{float(fitted.errors[-1]):.3g}")
    else:
        lines += [
            "",
            "# velocity_noise_rad_s and observer_gain_1_s stay: the recording has no measured velocities.",
            "# torque_noise_nm stays as well: the residuals contain the noise of both.",
        ]
    return "\n".join(lines) + "\n"


def _field(name: str, number: str, error: str, note: str = "") -> list[str]:
    return ["", f"[plant.{name}]", *([note] if note else []), f"value = {number}", f"standard_error = {error}"]


def _list(values: Iterable[float] | FloatArray) -> str:
    return f"[{', '.join(f'{float(v):.6g}' if abs(v) >= 1e-6 else '0.0' for v in values)}]"


def residual_figure(result: IdentifiedArm, model: RobotModel, title: str) -> Figure:
    """Draw measured and explained torques, one panel for each joint."""
    figure = Figure(figsize=(9, 1.6 * model.n + 1), layout="constrained")
    panels = figure.subplots(model.n, 1, sharex=True, squeeze=False)[:, 0]
    stamp = result.samples.stamp
    time, every = stamp - stamp[0], max(1, len(stamp) // _MOST_POINTS)
    for j, axes in enumerate(panels):
        axes.plot(time[::every], result.samples.tau[::every, j], color="0.7", lw=0.6, label="residual")
        axes.plot(time[::every], result.fit.expected[::every, j], color="tab:blue", lw=0.9, label="explained")
        for k, (begin, end) in enumerate(result.spans):
            label = "left out" if k == 0 else None
            axes.axvspan(begin - stamp[0], end - stamp[0], color="tab:red", alpha=0.2, label=label)
        axes.set_ylabel(f"{model.joints[j]}\n[Nm]", fontsize="small")
    panels[-1].set_xlabel("time [s]")
    panels[0].legend(fontsize="x-small", loc="upper right")
    figure.suptitle(title, fontsize="medium")
    return figure
