"""Errors of `pretouch identify` on simulated arms whose joints swing along sines, and coverage of its intervals.

python -m pretouch_lab.bench.identification          # eight arms of `realistic`, 60 s each
python -m pretouch_lab.bench.identification rough    # with encoder noise, late stamps and lost samples
"""

import sys
from dataclasses import replace

import numpy as np
from rich.console import Console

from pretouch.cli.tables import show
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.randomisation import drawn, world_set
from pretouch.sim.scene import SceneSpec
from pretouch_lab.identification.identify import identify
from pretouch_lab.identification.recording import ArmSamples
from pretouch_lab.run import Row
from pretouch_lab.table import Column, summary, table

SEEDS, SECONDS = range(1020, 1028), 60.0
_PERIOD_S, _AMPLITUDE_RAD = 0.01, 0.4
_RATE = 2 * np.pi * np.array([0.11, 0.13, 0.17, 0.19, 0.23, 0.29, 0.31])
"""Angular frequency of each joint's sine [rad/s]."""
_COLUMNS = (
    Column("number", "number"),
    Column("within 95 %", "within", of="trials"),
    Column("off by, median", "off", 4),
    Column("of its standard errors", "sigmas", 1),
)


def swung(seed: int) -> tuple[ArmSamples, Plant]:
    """Swing the joints of an arm drawn by the seed; return its samples and the arm."""
    model = RobotModel(panda())
    plant = Plant(model, SceneSpec(), drawn(world_set("realistic"), seed).plant, model.description.q_ready, seed)
    rows = []
    for _ in range(round(SECONDS / _PERIOD_S)):
        plant.command(_AMPLITUDE_RAD * _RATE * np.sin(_RATE * plant.time))
        plant.advance(_PERIOD_S)
        plant.take_log()
        state = plant.read()
        rows.append((state.stamp, state.q, state.qd, state.tau_ext))
    return ArmSamples(*(np.array(column) for column in zip(*rows, strict=True))), plant


def rough(samples: ArmSamples, seed: int) -> ArmSamples:
    """Add encoder noise and quantisation, delays of stamps up to 2 ms, lost samples, and gaps of 60 ms."""
    rng, count = np.random.default_rng(seed), len(samples.stamp)
    arrived = (rng.random(count) > 0.005) & (np.arange(count) % 500 > 5)
    q = 1e-5 * np.round((samples.q + 2e-5 * rng.standard_normal(samples.q.shape)) / 1e-5)
    late = replace(samples, stamp=samples.stamp + rng.uniform(0.0, 0.002, count), q=q)
    return late.at(arrived)


def trial(seed: int, roughly: bool = False) -> list[Row]:
    """Identify an arm; return a row for each number that the recording determines."""
    samples, plant = swung(seed)
    arm = identify(rough(samples, seed) if roughly else samples, RobotModel(panda()), PlantParams())
    truth = plant.params
    f1 = (1.0 - truth.friction_compensated) * np.array(truth.friction_f1_nm)
    true = {field: getattr(truth, field, None) for field in (quantity.field for quantity in arm.of_joints())}
    true |= {"offsets_nm": plant.offset_nm, "friction_f1_nm": f1, "ripple_phases_rad": None}
    numbers = [
        ("payload [kg]", *arm.fit.payload, plant.error.payload),
        ("observer gain [1/s]", arm.fit.gain, float(arm.fit.errors[-1]), truth.observer_gain_1_s),
    ]
    if noise := arm.noise:
        velocity = noise.velocity_rad_s, noise.velocity_error_rad_s, truth.velocity_noise_rad_s
        numbers.append(("velocity noise [rad/s]", *velocity))
    for quantity in arm.of_joints():
        if (right := true[quantity.field]) is not None:
            every = zip(quantity.values, quantity.standard_errors, np.asarray(right), strict=True)
            numbers += [(quantity.name, *each) for each, sure in zip(every, quantity.identified, strict=True) if sure]
    rows = [(name, abs(value - right), error) for name, value, error, right in numbers]
    return [{"number": n, "off": off, "sigmas": off / e, "within": bool(off < 1.96 * e)} for n, off, e in rows]


def main(how: str = "") -> None:
    """Identify all arms, and print the errors of the numbers."""
    numbers = [row for seed in SEEDS for row in trial(seed, how == "rough")]
    rows = summary(numbers, ("number",), ("off", "sigmas"), ("within",))
    show(Console(), [table(f"Numbers of {len(SEEDS)} arms", _COLUMNS, rows)])


if __name__ == "__main__":
    main(*sys.argv[1:])
