"""An arm left alone in an empty room, without a skin and without a reaction: what its force estimate is of nothing."""

from dataclasses import dataclass, field, replace

import numpy as np

from pretouch.contact.decaying_velocity import DecayingVelocity
from pretouch.contact.thresholds import noise_force
from pretouch.control.path import Path
from pretouch.params import TaskParams
from pretouch.sensing.skin import Skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.cell import Cell, Context
from pretouch_lab.paper.claims.detectors import TABLE_I, Windowed, band, dispersion_of, onsets, rate_bounds
from pretouch_lab.rows import Row, rounded
from pretouch_lab.trial import SETTLE_S, Record, play

PROFILE = "blind:detect.f_base_n=1000"
"""Nothing is near, and no force is a contact: the course of the estimate is that of an arm that is left alone."""
DURATION_S = 150.0
"""Time that counts [s]: that in which the window fills comes before it."""

_PERIOD_S = TaskParams().control_period_s
_ANSWERED = DecayingVelocity().decay_cycles
"""Control cycles for which a detection is answered."""


@dataclass(frozen=True)
class Standing:
    """A path that is one point, so that the arm stands."""

    at: FloatArray
    """(3,) [m], base frame."""
    length: float = 0.0
    closed: bool = False

    def point(self, _phase: float) -> FloatArray:
        """Return the point (3,) [m]."""
        return self.at

    def tangent(self, _phase: float) -> FloatArray:
        """Return no direction (3,)."""
        return np.zeros(3)


@dataclass(frozen=True)
class Solitude:
    """What an arm that is left alone does."""

    path: Path
    speed_m_s: float = TaskParams().speed_m_s
    """Largest speed along the path [m/s]."""
    plant: PlantParams = field(default_factory=PlantParams)
    duration_s: float = DURATION_S


def leave_alone(what: Solitude, cell: Cell, seed: int, context: Context) -> Record:
    """Leave a cell's arm alone for as long as that takes; a seed makes one arm."""
    profile = context.profile(cell)
    setup = context.setup(
        cell,
        seed,
        SceneSpec(),
        what.path,
        skin=Skin([], context.model),
        profile=replace(profile, task=replace(profile.task, speed_m_s=what.speed_m_s)),
        plant=what.plant,
    )
    end = SETTLE_S + profile.window.samples * _PERIOD_S + what.duration_s
    return play(setup, lambda step, _: step.stamp >= end - 0.5 * _PERIOD_S)


def estimates(record: Record) -> FloatArray:
    """Force estimates (S, 3) [N] as the window is given them: where the robot has none, there is no sample."""
    force = record.forces()
    return force[np.isfinite(force).all(axis=1)]


def estimate_results(course: Windowed) -> Row:
    """Hours, and of the estimate: offset, spread and deviation per axis, norm, and what eq. 10 makes of it."""
    offset = course.force.mean(axis=0)
    norm = np.linalg.norm(course.force, axis=1)
    f_sigma = noise_force(course.sigma, TABLE_I.f_std_n, TABLE_I.sigma_max_n)
    return {
        "hours": len(norm) * _PERIOD_S / 3600,
        "offset_n": _listed(offset),
        "std_n": _listed(course.force.std(axis=0, ddof=1)),
        "largest_deviation_n": _listed(np.abs(course.force - offset).max(axis=0)),
        "norm_median_n": rounded(float(np.median(norm))),
        "norm_p95_n": rounded(float(np.percentile(norm, 95))),
        "norm_p99_n": rounded(float(np.percentile(norm, 99))),
        "norm_max_n": rounded(float(norm.max())),
        "f_sigma_n": _listed(np.median(f_sigma, axis=0)),
        "band_n": _listed(np.median(band(course, TABLE_I.f_base_n), axis=0)),
        "f_sigma_capped": _listed((course.sigma >= TABLE_I.sigma_max_n).mean(axis=0)),
    }


def _listed(values: FloatArray) -> list[float]:
    return [rounded(value, 4) for value in values]


def tally(detector: str, detected: BoolArray, force_n: float, near: bool) -> Row:
    """Count the false detections of a detector, held with a force [N], with objects near or with nothing near."""
    return {"detector": detector, "force_n": force_n, "near": near, "count": len(onsets(detected, _ANSWERED))}


def false_rates(rows: list[Row]) -> list[Row]:
    """False detections per hour, of each detector in all trials together, with bounds of 95 %.

    The bounds are Poisson's, wider by how much more the counts of the arms scatter than such counts do: an arm that
    has any has many. `arms` says how many seeds had any.
    """
    hours = sum(row["hours"] for row in rows)
    counts: dict[tuple[str, float, bool], list[tuple[int, int]]] = {}
    for row in rows:
        for found in row["detections"]:
            key = (found["detector"], found["force_n"], found["near"])
            counts.setdefault(key, []).append((row["seed"], found["count"]))
    rates = []
    for (detector, force_n, near), found in counts.items():
        by_arm: dict[int, int] = {}
        for seed, n in found:
            by_arm[seed] = by_arm.get(seed, 0) + n
        count = sum(by_arm.values())
        low, high = rate_bounds(count, hours, dispersion_of(list(by_arm.values())))
        rates.append(
            {
                "detector": detector,
                "force_n": force_n,
                "near": near,
                "count": count,
                "arms": sum(n > 0 for n in by_arm.values()),
                "of_arms": len(by_arm),
                "hours": rounded(hours, 4),
                "per_hour": rounded(count / hours),
                "low_per_hour": rounded(low),
                "high_per_hour": rounded(high),
            }
        )
    return rates


def rate_text(rate: Row | None) -> str:
    """Write a rate with its bounds below it, or a dash where there is none."""
    if rate is None:
        return "-"
    value, low, high = (_short(rate[key]) for key in ("per_hour", "low_per_hour", "high_per_hour"))
    return f"{value}\n{low}-{high}"


def _short(value: float) -> str:
    return f"{value:.2g}" if value < 9.95 else f"{value:.0f}"
