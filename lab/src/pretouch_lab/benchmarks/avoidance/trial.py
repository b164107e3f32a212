"""One trial of the avoidance benchmark: played, measured, and kept as a row."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.profiles import profile
from pretouch_lab.baselines.avoidance import profile_text
from pretouch_lab.benchmarks.avoidance import measures
from pretouch_lab.benchmarks.avoidance.livelock import livelocks
from pretouch_lab.benchmarks.avoidance.obstacle import Truth, truth_of
from pretouch_lab.benchmarks.avoidance.scenario import Scenario, scenarios
from pretouch_lab.benchmarks.avoidance.setting import PANDA, Setting, setting
from pretouch_lab.run import Row
from pretouch_lab.trial import Record, play

_D_MAX_M = 0.8
_COURSE_EVERY = 5


def measured(record: Record, made: Setting, params: Row) -> Row:
    """Return all measures of a trial, without its names."""
    setup = made.setup
    truth = truth_of(record, setup.model, map(made.shape, record.hand_position))
    held = params["path"]["kind"] == "held"
    return {
        **measures.contact(record, truth, params["obstacle"].get("d_max_m", _D_MAX_M)),
        **measures.tracking(record, setup.path.length, held),
        **measures.smoothness(record, setup.profile.task.control_period_s),
        **measures.dexterity(record, truth, setup.model),
        **measures.holds(record),
        **measures.reactions(record),
        **measures.seen(record, truth, made),
        **livelocks(record, made, params.get("livelock")),
        "timed": "turns" in params,
        "duration_s": round(record.steps[-1].stamp, 3),
        "course": course(record, truth),
    }


def course(record: Record, truth: Truth) -> dict[str, list[float]]:
    """Distance and force over time, thinned out, for the figures."""
    force = np.linalg.norm(record.true_force, axis=1)
    chosen = range(0, len(record.steps), _COURSE_EVERY)
    times = [record.steps[i].stamp for i in chosen]
    edges = np.searchsorted(record.true_time, [times[0] - 0.05, *times])
    largest = [float(force[a:b].max(initial=0.0)) for a, b in pairwise(edges)]
    return {
        "time_s": [round(t, 3) for t in times],
        "distance_m": [round(float(truth.distance[i]), 4) for i in chosen],
        "force_n": [round(f, 2) for f in largest],
        "way_m": [round(record.steps[i].path_phase, 4) for i in chosen],
    }


def play_trial(scenario: Scenario, baseline: str, seed: int, world: str = "", arm: str = PANDA) -> Row:
    """Play a trial of a baseline, as its seed draws it of a set if one is named, and return its row."""
    made = setting(scenario, profile(profile_text(baseline)), seed, arm)
    record = play(replace(made.setup, world=world), made.done)
    names: Row = {"contender": baseline, "scenario": scenario.name, "family": scenario.family, "seed": seed}
    if world:
        names["world"] = world
    return {**names, **measured(record, made, scenario.params)}


def keep_trial(name: str, baseline: str, seed: int, world: str, arm: str, file: Path) -> None:
    """Play a trial of the scenario of a name, and write its row to a file."""
    write_json(play_trial(scenarios()[name], baseline, seed, world, arm), file)
