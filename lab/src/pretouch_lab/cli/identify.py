"""`pretouch identify`: parameters of a simulated arm from a recording of free motion, as table, figure and file."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

from pretouch.cli.options import JsonFile

if TYPE_CHECKING:  # the help must not import heavy packages
    from pretouch.robot.model import RobotModel
    from pretouch_lab.identification.identify import IdentifiedArm


@dataclass(frozen=True)
class Identify:
    """Estimate an arm's offsets, friction, ripple, masses and noise from free motion, for a simulation of this arm.

    Nothing may touch the arm. Record about two minutes along smooth paths that turn all joints, below 0.5 m/s. A number
    that the recording does not determine keeps its default, and the file says so.
    """

    file: tyro.conf.Positional[str]
    """Recording of Pretouch, or .csv with time_s, q1_rad ..., optionally qd1_rad_s ..., and tau_ext1_Nm ... or
    tau1_Nm ... (measured torques, at 400 Hz or more)."""
    arm: str = ""
    """panda, fr3, or the folder of an arm from `pretouch robot import`; by default the arm of a recording of Pretouch,
    else a Panda."""
    # not imported: the help must not import heavy packages
    sign: Literal["on-robot", "by-robot"] = "on-robot"
    """Sign of the external torques of a CSV file: on the robot by its environment, or by the robot."""
    out: str = ""
    """TOML file for the arm, the argument of --world in `live`, `reproduce` and `bench`."""
    figure: str = ""
    """File for a figure of measured and explained torques over time, ending in .png, .pdf or .svg."""
    json: JsonFile = None

    def run(self) -> None:
        """Identify the arm, and print and write the result."""
        from pretouch.atomic_write import atomic_write
        from pretouch.cli.writing import check_writable, numbers_to, unwritable_said
        from pretouch.errors import RecordingError
        from pretouch.robot.description import robot_named
        from pretouch.robot.model import RobotModel
        from pretouch.sim.plant_params import plant_params_of
        from pretouch_lab.identification.arm_file import arm_toml, residual_figure
        from pretouch_lab.identification.identify import identify
        from pretouch_lab.identification.recording import read_free_motion

        out, figure = (Path(text) if text else None for text in (self.out, self.figure))
        if figure and figure.suffix not in (".png", ".pdf", ".svg"):
            raise RecordingError(f"The figure {figure} has no known format: end its name in .png, .pdf or .svg.")
        for what, place in (("file", out), ("figure", figure)):
            if place:
                check_writable(what, place)
        with numbers_to(self.json) as write:
            arm = RobotModel(robot_named(self.arm)) if self.arm else None
            samples, model, source = read_free_motion(Path(self.file), arm, self.sign)
            result = identify(samples, model, plant_params_of(model.description))
            if figure:
                image = BytesIO()
                residual_figure(result, model, self.file).savefig(image, format=figure.suffix[1:], dpi=120)
                with unwritable_said("figure", figure):
                    figure.write_bytes(image.getvalue())
            if out:
                with unwritable_said("file", out):
                    atomic_write(out, arm_toml(result, model, Path(self.file).name))
            _show(result, model, source)
            for what, place in (("Arm", out), ("Figure", figure)):
                if place:
                    print(f"{what}: {place}")
            write(_numbers(result, model, self.file))


def _show(result: "IdentifiedArm", model: "RobotModel", source: str) -> None:
    from rich.console import Console

    from pretouch.cli.tables import PlainTable

    console = Console(highlight=False, soft_wrap=True)
    for line in (f"{source}. {result.seconds:.0f} s of free motion are used.", *result.notes):
        console.print(line, markup=False)
    rows = result.of_joints()
    texts = ("({:.3g} +- {:.1g})", "{:.3g} +- {:.1g}")
    numbers = [zip(row.identified, row.values, row.standard_errors, strict=True) for row in rows]
    columns = [[texts[int(sure)].format(*number) for sure, *number in each] for each in numbers]
    table = [[joint, *cells] for joint, *cells in zip(model.joints, *columns, strict=True)]
    console.print(PlainTable(["joint", *(row.name for row in rows)], table), crop=False)
    payload, error = result.fit.payload
    lines = [f"Payload {payload:.3f} +- {error:.3f} kg."]
    if result.noise is not None:
        lines.append(
            f"Velocity noise {result.noise.velocity_rad_s:.4f} rad/s; observer gain {result.fit.gain:.1f} +-"
            f" {result.fit.errors[-1]:.1f} 1/s."
        )
    else:
        lines.append("Without velocities neither their noise nor the observer's gain is identified.")
    lines.append(
        "In brackets: the recording hardly determines the number, and it stays near its default. Errors are standard"
        " errors. Friction is the part that the robot does not compensate. In simulation the errors of offsets, ripple"
        " and payload were two and a half times as large as their standard errors."
    )
    for line in lines:
        console.print(line, markup=False)


def _numbers(result: "IdentifiedArm", model: "RobotModel", source: str) -> dict[str, Any]:
    fitted, noise = result.fit, result.noise
    return {
        "recording": source,
        "arm": model.description.name,
        "joints": model.joints,
        "used_s": result.seconds,
        "notes": result.notes,
        "contact_spans_s": result.spans,
        "of_joints": result.of_joints(),
        "payload_kg": fitted.payload,
        "velocity_noise_rad_s": noise.velocity_rad_s if noise else None,
        "observer_gain_1_s": [fitted.gain, fitted.errors[-1]] if noise else None,
    }
