"""An identified arm as a world file, TOML that every simulation takes (`sim.randomisation`); and as a figure."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.identification.fit import OWN
from pretouch_lab.identification.identify import Identified

_MOST_POINTS = 4000


def arm_toml(found: Identified, model: RobotModel, source: str) -> str:
    """Return the file's text; what could not be identified keeps its usual value, and a comment says so."""
    n, fitted, noise = model.n, found.fit, found.noise
    own, errors = fitted.of_joints(fitted.numbers), fitted.of_joints(fitted.errors)
    known = found.known()
    identifiable = fitted.of_joints(known.astype(np.float64)) > 0.5
    kept = 1.0 - found.usual.friction_compensated
    ripple, ripple_error, phase = found.ripple()
    lines = [
        f"about = {_quoted(f'An arm identified from {source}: {found.seconds:.0f} s of free motion.')}",
        "",
        f"# friction_compensated stays at {found.usual.friction_compensated:g}: only what is not compensated shows, so",
        f"# friction_f1_nm is that, divided by {kept:g}.",
        f"# torque_noise_hz stays at {found.usual.torque_noise_hz:g}: the observer hides it.",
        "# stiffness, damping, rotor inertia and delays stay as they are: a residual does not tell them.",
        *_field("offsets_nm", own[:, 0], errors[:, 0], identifiable[:, 0]),
        *_field("friction_f1_nm", own[:, 1] / kept, errors[:, 1] / kept, identifiable[:, 1], at_least=0.0),
        *_field("friction_f2_s_rad", np.exp(own[:, 2]), np.exp(own[:, 2]) * errors[:, 2], identifiable[:, 2]),
        *_field("friction_f3_rad_s", own[:, 3], errors[:, 3], identifiable[:, 3]),
        *_field("ripple_nm", ripple, ripple_error, identifiable[:, 4] & (ripple > 3.0 * ripple_error)),
        *_field("ripple_phases_rad", phase, ripple_error / np.maximum(ripple, 1e-9), np.ones(n, np.bool_)),
        *_masses(found, model, known),
    ]
    if np.isfinite(noise.velocity_rad_s):
        lines += _field("torque_noise_nm", noise.torque_nm, noise.torque_errors_nm, noise.torque_nm > 0.0)
        lines += _number("velocity_noise_rad_s", noise.velocity_rad_s, noise.velocity_error_rad_s)
        lines += _number("observer_gain_1_s", fitted.gain, float(fitted.errors[-1]))
    else:
        lines += [
            "",
            "# velocity_noise_rad_s and observer_gain_1_s stay: the recording has no measured velocities.",
            "# torque_noise_nm stays as well: what is left of the torques has the noise of both in it.",
        ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _masses(found: Identified, model: RobotModel, known: BoolArray) -> list[str]:
    """Factors of the links' masses, those behind the same joint alike, and the payload."""
    n, first = model.n, OWN * model.n
    factors, errors = np.ones(len(model.links)), np.zeros(len(model.links))
    for link in range(len(model.links)):
        moved = np.flatnonzero(model.moved_by[link])
        if len(moved):
            factors[link] = max(1.0 + found.fit.numbers[first + moved[-1]], 0.05)
            errors[link] = found.fit.errors[first + moved[-1]]
    unsure = [model.joints[j] for j in range(n) if not known[first + j]]
    said = [f"# the links behind {', '.join(unsure)}: what was assumed before is hardly changed"] if unsure else []
    payload = float(found.fit.numbers[first + n])
    return [
        *_field("mass_factors", factors, errors, np.ones(len(factors), np.bool_)), *said,
        *_number("payload_kg", max(payload, 0.0), float(found.fit.errors[first + n])),
    ]  # fmt: skip


def _field(
    name: str, values: FloatArray, errors: FloatArray, identifiable: BoolArray, at_least: float | None = None
) -> list[str]:
    shown = values if at_least is None else np.maximum(values, at_least)
    unsure = [str(j + 1) for j in np.flatnonzero(~identifiable)]
    said = [f"# joints {', '.join(unsure)}: the recording hardly tells"] if unsure else []
    return ["", f"[plant.{name}]", *said, f"value = {_list(shown)}", f"standard_error = {_list(errors)}"]


def _number(name: str, number: float, error: float) -> list[str]:
    return ["", f"[plant.{name}]", f"value = {number:.6g}", f"standard_error = {error:.3g}"]


def _list(values: Sequence[float] | FloatArray) -> str:
    return f"[{', '.join(f'{float(v):.6g}' if abs(v) >= 1e-6 else '0.0' for v in values)}]"


def _quoted(text: str) -> str:
    return '"' + "".join(c if c.isprintable() and c not in '"\\' else "_" for c in text) + '"'


def residual_figure(found: Identified, model: RobotModel, title: str) -> Figure:
    """Draw one row a joint."""
    figure = Figure(figsize=(11, 1.6 * model.n + 1), layout="constrained")
    panels = figure.subplots(model.n, 2, sharex="col", squeeze=False, width_ratios=(3, 1))
    time, every = found.time - found.time[0], max(1, len(found.time) // _MOST_POINTS)
    lags = found.noise.period_s * np.arange(len(found.noise.autocorrelation))
    for j, (left, right) in enumerate(panels):
        left.plot(time[::every], found.tau[::every, j], color="0.7", lw=0.6, label="residual")
        left.plot(time[::every], found.fit.expected[::every, j], color="tab:blue", lw=0.9, label="explained")
        for k, (begin, end) in enumerate(found.spans):
            label = "left out" if k == 0 else None
            left.axvspan(begin - found.time[0], end - found.time[0], color="tab:red", alpha=0.2, label=label)
        left.set_ylabel(f"{model.joints[j]}\n[Nm]", fontsize="small")
        right.plot(lags, found.noise.autocorrelation[:, j], color="0.5", marker=".", label="about the mean")
        right.plot(
            lags, found.noise.left_autocorrelation[:, j], color="tab:blue", marker=".",
            label="less the velocities' noise",
        )  # fmt: skip
        right.axhline(0.0, color="black", lw=0.5)
    panels[-1][0].set_xlabel("time [s]")
    panels[-1][1].set_xlabel("lag [s]")
    panels[0][0].legend(fontsize="x-small", loc="upper right")
    panels[0][1].legend(fontsize="x-small")
    panels[0][1].set_title("autocorrelation", fontsize="small")
    figure.suptitle(title, fontsize="medium")
    return figure
