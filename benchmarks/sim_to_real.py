"""How well `pretouch identify` finds a simulated arm, and how like it the simulation then is.

    python benchmarks/sim_to_real.py --seeds 1010 1011 --world realistic --out runs/sim-to-real.json

A seed of a world makes the "real" arm. It is recorded in free motion by the usual recorder and identified from the file
alone. Then the identified arm, and another seed of the usual arm, are recorded along the same path, and what they say
is compared: mean, size and autocorrelation of the torques, evidence and alarms of detectors.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pretouch.control.path import WayPoints
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.randomisation import drawn, world_set
from pretouch.sim.scene import SceneSpec
from pretouch.types import Obstacles, RobotState
from pretouch_lab.identification.arm_file import arm_toml
from pretouch_lab.identification.identify import identify
from pretouch_lab.identification.recording import ArmSamples, read_free_motion
from pretouch_lab.replay import DetectorAlone
from pretouch_lab.trial import Setup, play

PATH = WayPoints(
    np.array([[0.4, 0.45, 0.5], [0.6, 0.2, 0.3], [0.5, -0.1, 0.7], [0.35, -0.45, 0.35], [0.55, -0.2, 0.55]]),
    closed=True,
)
_ALONE = "blind:detect.f_base_n=1000:task.orientation=free"
_DETECTORS = {"pretouch": "pretouch:detect.learn=always", "fixed": "fixed"}
MODEL = RobotModel(panda())


def recorded(plant: PlantParams, seed: int, seconds: float, place: Path) -> tuple[ArmSamples, Plant]:
    """Record an arm that is left alone, and read the recording."""
    found, kept = profile(_ALONE), []
    found = replace(found, task=replace(found.task, speed_m_s=0.25))
    setup = Setup(
        model=MODEL, skin=Skin([], MODEL), profile=found, scene=SceneSpec(), path=PATH, seed=seed, plant=plant,
        recording=place, prepare=lambda arm, _: kept.append(arm),
    )  # fmt: skip
    play(setup, lambda step, _: step.stamp >= seconds)
    return read_free_motion(place, None)[0], kept[0]


def deviations(found, plant: Plant) -> dict[str, list[float]]:
    """How many standard errors each number is off the truth, of those that the recording tells."""
    p, fitted, noise, always = plant.params, found.fit, found.noise, np.array([True])
    truths = {
        "offsets_nm": plant.offset_nm,
        "friction_f1_nm": (1 - p.friction_compensated) * np.array(p.friction_f1_nm),
        "friction_f2_s_rad": np.array(p.friction_f2_s_rad),
        "friction_f3_rad_s": np.array(p.friction_f3_rad_s),
        "ripple_nm": np.array(p.ripple_nm),
        "torque_noise_nm": np.array(p.torque_noise_nm),
    }
    truth = {
        row.name: (row.values, row.standard_errors, truths[row.field], row.identified)
        for row in found.of_joints()
        if row.field in truths
    }
    numbers = {
        "payload [kg]": (*fitted.payload, plant.error.payload),
        "observer gain [1/s]": (fitted.gain, fitted.errors[-1], p.observer_gain_1_s),
        "velocity noise [rad/s]": (noise.velocity_rad_s, noise.velocity_error_rad_s, p.velocity_noise_rad_s),
    }
    truth |= {name: (*(np.array([each]) for each in three), always) for name, three in numbers.items()}
    return {
        name: [[(v - t) / e, v - t, t] for v, e, t, ok in zip(*values, strict=True) if ok]
        for name, values in truth.items()
    }


def said(samples: ArmSamples) -> dict[str, object]:
    """What an arm's torques are like, and how often detectors find a contact in them."""
    tau = samples.tau[200:]
    centred = tau - tau.mean(axis=0)
    acf = [
        float(np.mean((centred[k:] * centred[: len(centred) - k]).mean(axis=0) / centred.var(axis=0))) for k in (1, 5)
    ]
    found = {"mean": tau.mean(axis=0).tolist(), "rms": np.sqrt((tau**2).mean(axis=0)).tolist(), "acf": acf}
    nothing = {name: np.zeros((0, 3)) for name in ("point", "body_point", "direction")}
    nothing |= {name: np.zeros(0) for name in ("ee_distance", "body_distance", "closing_speed")}
    none = Obstacles(unit=np.zeros(0, np.int64), link=np.zeros(0, np.int64), **nothing)
    for name, text in _DETECTORS.items():
        p, evidence, alarms, quiet = profile(text), [], 0, 0
        detector = DetectorAlone(p, MODEL)
        for i in range(len(samples.stamp)):
            robot = RobotState(
                float(samples.stamp[i]), samples.q[i], samples.qd[i], samples.q[i], samples.qd[i], samples.tau[i], None
            )  # fmt: skip
            felt = detector.step(MODEL.kinematics(samples.q[i]), robot, none)
            if i > len(samples.stamp) // 3:
                evidence.append(felt.evidence)
                # not `contact`: without a wrench the paper's window never fills, and nothing is armed
                alarms += felt.evidence >= 1.0 and i > quiet
                quiet = i + 200 if felt.evidence >= 1.0 else quiet
        found[name] = {"alarms": int(alarms), "evidence": np.percentile(evidence, [50, 95, 99]).tolist()}
    return found


def study(world: str, seed: int, seconds: float) -> dict[str, object]:
    """Identify one arm, set the simulation to it, and compare."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        real = drawn(world_set(world), seed).plant
        samples, plant = recorded(real, seed, seconds, place / "real.mcap")
        found = identify(samples, MODEL, PlantParams())
        (place / "arm.toml").write_text(arm_toml(found, MODEL, "real.mcap"))
        same = drawn(world_set(str(place / "arm.toml")), seed).plant
        arms = {
            "real": samples,
            "identified": recorded(same, seed + 500, seconds, place / "same.mcap")[0],
            "usual": recorded(PlantParams(), seed + 500, seconds, place / "usual.mcap")[0],
        }
        compared = {name: said(of) for name, of in arms.items()}
    return {"world": world, "seed": seed, "deviations": deviations(found, plant), "used_s": found.seconds,
            "notes": list(found.notes), "compared": compared}  # fmt: skip


def rough(samples: ArmSamples, seed: int) -> ArmSamples:
    """As a recording may be: noise and steps of encoders, stamps late by up to 2 ms, samples lost, gaps of 60 ms."""
    rng, count = np.random.default_rng(seed), len(samples.stamp)
    kept = (rng.random(count) > 0.005) & (np.arange(count) % 500 > 5)
    q = 1e-5 * np.round((samples.q + 2e-5 * rng.standard_normal(samples.q.shape)) / 1e-5)
    late = replace(samples, stamp=samples.stamp + rng.uniform(0.0, 0.002, count), q=q)
    return late.at(kept)


def swung(seed: int, world: str, seconds: float, roughly: bool) -> dict[str, object]:
    """Swing an arm's joints along sines, identify it, and say how far the numbers are off."""
    plant = Plant(MODEL, SceneSpec(), drawn(world_set(world), seed).plant, MODEL.description.q_ready, seed)
    rate, rows = 2 * np.pi * np.array([0.11, 0.13, 0.17, 0.19, 0.23, 0.29, 0.31]), []
    for _ in range(round(seconds / 0.01)):
        plant.command(0.4 * rate * np.sin(rate * plant.time))
        plant.advance(0.01)
        plant.take_log()
        state = plant.read()
        rows.append((state.stamp, state.q, state.qd, state.tau_ext))
    samples = ArmSamples(*(np.array(column) for column in zip(*rows, strict=True)))
    found = identify(rough(samples, seed) if roughly else samples, MODEL, PlantParams())
    return {"world": world, "seed": seed, "deviations": deviations(found, plant), "notes": list(found.notes)}


def coverage(rows: list[dict[str, object]]) -> None:
    """Say how many numbers lie within 95 % intervals, and how far they are off."""
    for name in rows[0]["deviations"]:
        all_of = np.array([each for row in rows for each in row["deviations"][name]])
        inside, off = int((np.abs(all_of[:, 0]) < 1.96).sum()), np.median(np.abs(all_of[:, 1]))
        spread = np.sqrt(np.mean(all_of[:, 0] ** 2))
        print(
            f"{name:34} {inside}/{len(all_of)} within 1.96 standard errors, rms {spread:.2f} of them, off by {off:.3g}"
        )


def main() -> None:
    """Study each seed and add a line to the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1010])
    parser.add_argument("--world", default="realistic")
    parser.add_argument("--seconds", type=float, default=90.0)
    parser.add_argument("--out", type=Path, default=Path("sim-to-real.jsonl"))
    parser.add_argument("--swung", action="store_true", help="only how far the numbers are off, of joints that swing")
    parser.add_argument("--rough", action="store_true", help="with --swung: noise of encoders, uneven stamps, losses")
    given = parser.parse_args()
    if given.swung:
        rows = [swung(seed, given.world, given.seconds, given.rough) for seed in given.seeds]
        given.out.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
        coverage(rows)
        return
    for seed in given.seeds:
        row = study(given.world, seed, given.seconds)
        with given.out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(json.dumps(row["compared"]), flush=True)


if __name__ == "__main__":
    main()
