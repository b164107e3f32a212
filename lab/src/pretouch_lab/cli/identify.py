"""`pretouch identify`: from recordings of free motion to a simulated arm like it, as table, figure and file."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from pretouch.cli.options import JsonFile

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch.robot.model import RobotModel
    from pretouch_lab.identification.identify import Identified


@dataclass(frozen=True)
class Identify:
    """Estimate an arm's offsets, friction, ripple, masses and noise from free motion, for the simulation to be like it.

    Nothing may touch the arm; two minutes along smooth paths that turn all joints, below 0.5 m/s, are good. What cannot
    be identified from the recording keeps its usual value, and the file says so.
    """

    file: tyro.conf.Positional[str]
    """Recording of ours, or .csv with time_s, q1_rad ..., qd1_rad_s ... if there are any, and tau_ext1_Nm ... or
    tau1_Nm ... (measured torques, at 400 Hz or more)."""
    arm: str = ""
    """panda, fr3, or the folder of an arm that `pretouch robot import` wrote; by default what a recording of ours says,
    or a Panda."""
    # the choices of pretouch_lab.identification.free_motion, spelt out: the help is to need none of the heavy packages
    sign: Literal["on-robot", "by-robot"] = "on-robot"
    """Whose the external torques of a CSV file are: on the robot by its environment, or by the robot."""
    out: str = ""
    """TOML file for the arm, for --world of `live`, `reproduce` and `bench`."""
    figure: str = ""
    """Figure to write, ending in .png, .pdf or .svg: what is explained over time, and the autocorrelation."""
    json: JsonFile = None

    def run(self) -> None:
        """Identify the arm, and show and write what was found."""
        from pretouch.cli.writing import check_writable, numbers_to
        from pretouch.errors import RecordingError

        out, figure = (Path(text) if text else None for text in (self.out, self.figure))
        if figure and figure.suffix not in (".png", ".pdf", ".svg"):
            raise RecordingError(f"The figure {figure} has no ending that says its format: use .png, .pdf or .svg.")
        for what, place in (("file", out), ("figure", figure)):
            if place:
                check_writable(what, place)
        with numbers_to(self.json) as write:
            write(_identified(self, out, figure))


def _identified(command: Identify, out: Path | None, figure: Path | None) -> dict[str, Any]:
    from pretouch.atomic_write import atomic_write
    from pretouch.cli.writing import unwritable_said
    from pretouch.robot.description import robot_named
    from pretouch.robot.model import RobotModel
    from pretouch.sim.plant_params import plant_params_of
    from pretouch_lab.identification.arm_file import arm_toml, residual_figure
    from pretouch_lab.identification.free_motion import read_free_motion
    from pretouch_lab.identification.identify import identify

    arm = RobotModel(robot_named(command.arm)) if command.arm else None
    samples, model, source = read_free_motion(Path(command.file), arm, command.sign)
    found = identify(samples, model, plant_params_of(model.description))
    if figure:
        image = BytesIO()
        residual_figure(found, model, command.file).savefig(image, format=figure.suffix[1:], dpi=120)
        with unwritable_said("figure", figure):
            figure.write_bytes(image.getvalue())
    if out:
        with unwritable_said("file", out):
            atomic_write(out, arm_toml(found, model, Path(command.file).name))
    _show(found, model, source)
    for what, place in (("Arm", out), ("Figure", figure)):
        if place:
            print(f"{what}: {place}")
    return _numbers(found, model, command.file)


def _show(found: "Identified", model: "RobotModel", source: str) -> None:
    from rich.console import Console

    from pretouch.cli.tables import PlainTable

    console = Console(highlight=False, soft_wrap=True)
    console.print(f"{source}. {found.seconds:.0f} s of free motion are used.", markup=False)
    for note in found.notes:
        console.print(note, markup=False)
    columns = [
        (name, *(_shown(*each) for each in zip(values, errors, identifiable, strict=True)))
        for name, values, errors, identifiable in joint_rows(found, model)
    ]
    heading, *rows = zip(("joint", *model.joints), *columns, strict=True)
    console.print(PlainTable(heading, rows), crop=False)
    payload, error = float(found.fit.numbers[-2]), float(found.fit.errors[-2])
    console.print(f"Payload {payload:.3f} +- {error:.3f} kg.", markup=False)
    noise = found.noise
    if noise.velocity_rad_s == noise.velocity_rad_s:
        console.print(
            f"Velocity noise {noise.velocity_rad_s:.4f} rad/s; observer gain {found.fit.gain:.1f} +-"
            f" {found.fit.errors[-1]:.1f} 1/s, by the autocorrelation {noise.gain_1_s:.0f} +-"
            f" {noise.gain_error_1_s:.0f} 1/s.",
            markup=False,
        )
    else:
        console.print("Without velocities neither their noise nor the observer's gain is identified.", markup=False)
    console.print(
        "In brackets: the recording hardly tells it, and it stays near what is usual. Errors are standard errors. Of"
        " the friction only what the robot does not compensate shows. In simulation offsets, ripple and"
        " payload were off by two and a half times as much.",
        markup=False,
    )


def _shown(number: float, error: float, identifiable: bool) -> str:
    text = f"{number:.3g} +- {error:.1g}"
    return text if identifiable else f"({text})"


def joint_rows(found: "Identified", model: "RobotModel") -> list[tuple[str, Any, Any, Any]]:
    """Return name, values, standard errors and whether the recording tells it, of what each joint has."""
    import numpy as np

    own, errors = found.fit.of_joints(found.fit.numbers), found.fit.of_joints(found.fit.errors)
    identifiable = found.fit.of_joints(found.known().astype(np.float64)) > 0.5
    ripple, ripple_error, _ = found.ripple()
    n, first = model.n, own.size
    mass = slice(first, first + n)
    steep = np.exp(own[:, 2])
    seen = np.isfinite(found.noise.velocity_rad_s)  # else the noise of velocities is in that of torques
    return [
        ("offset [Nm]", own[:, 0], errors[:, 0], identifiable[:, 0]),
        ("friction F1, not compensated [Nm]", own[:, 1], errors[:, 1], identifiable[:, 1]),
        ("friction F2 [s/rad]", steep, steep * errors[:, 2], identifiable[:, 2]),
        ("friction F3 [rad/s]", own[:, 3], errors[:, 3], identifiable[:, 3]),
        ("ripple [Nm]", ripple, ripple_error, ripple > 3.0 * ripple_error),
        ("mass error of its links", found.fit.numbers[mass], found.fit.errors[mass], found.known()[mass]),
        (
            "torque noise [Nm]",
            found.noise.torque_nm,
            found.noise.torque_errors_nm,
            seen & (found.noise.torque_nm > 0.0),
        ),
        ("spread about the mean [Nm]", found.noise.total_nm, 0.0 * ripple, ripple > -1.0),
    ]


def _numbers(found: "Identified", model: "RobotModel", source: str) -> dict[str, Any]:
    import numpy as np

    noise = found.noise
    return {
        "recording": source, "arm": model.description.name, "joints": model.joints, "used_s": found.seconds,
        "notes": found.notes, "contact_spans_s": found.spans,
        "of_joints": [
            {"name": name, "values": values, "standard_errors": errors, "told": identifiable}
            for name, values, errors, identifiable in joint_rows(found, model)
        ],
        "payload_kg": [found.fit.numbers[-2], found.fit.errors[-2]], "velocity_noise_rad_s": noise.velocity_rad_s,
        "observer_gain_1_s": [found.fit.gain, found.fit.errors[-1]] if np.isfinite(noise.velocity_rad_s) else None,
        "observer_gain_by_autocorrelation_1_s": [noise.gain_1_s, noise.gain_error_1_s],
        "correlation": noise.correlation, "lag_s": noise.period_s, "autocorrelation": noise.autocorrelation,
    }  # fmt: skip
