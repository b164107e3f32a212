"""What a detector's alarms are worth: false ones counted, true ones matched with the contacts that caused them."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.params import TaskParams
from pretouch.types import FloatArray
from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.benchmarks.detection.contacts import ContactCell, Touching, touches_of
from pretouch_lab.benchmarks.detection.free import FreeCell, warm_up_s
from pretouch_lab.benchmarks.detection.hard import HardCell
from pretouch_lab.benchmarks.detection.replay import REST, Replayed, replay
from pretouch_lab.benchmarks.detection.stream import Stream, load_stream
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import rounded

PERIOD_S = TaskParams().control_period_s
BUSY = -1.0
"""In place of a delay: an earlier alarm was still being answered when the contact began."""


def sweep_values(baseline: Baseline) -> list[float]:
    """Return the values at which a baseline's swept parameter is looked at."""
    return [float(value) for value in scenario("free")["curve"][baseline.sweep]]


def judge_free(cell: FreeCell | HardCell, baseline: Baseline, stream: Path, file: Path) -> None:
    """Count a detector's alarms in free motion after the warm-up, as it is and at each value of its sweep."""
    made = replay(load_stream(stream), baseline, model())
    counted = made.stamp >= warm_up_s()

    def alarms(onsets: list[int]) -> int:
        return int(counted[onsets].sum())

    row: Row = {
        **asdict(cell),
        "contender": baseline.name,
        "hours": float(counted.sum()) * PERIOD_S / 3600,
        "alarms": alarms(made.onsets()),
        "sweep": [alarms(made.onsets(value)) for value in sweep_values(baseline)],
    }
    write_json(row, file)


def judge_contacts(cell: ContactCell | HardCell, baseline: Baseline, stream: Path, file: Path) -> None:
    """Match a detector's alarms with the contacts of a stream, as it is and at each value of its sweep."""
    kept = load_stream(stream)
    made = replay(kept, baseline, model())
    touches = touches_of(kept)
    found = matched(touches, made.stamp, made.onsets())
    swept = [matched(touches, made.stamp, made.onsets(value)) for value in sweep_values(baseline)]
    noise = quiet_spread(kept, touches[0].start)
    contacts = [
        {
            **about(touch, kept, noise),
            "delay_s": _delay(found[k]),
            "towards": _towards(found[k], touch, kept, made),
            "sweep_s": [_delay(at[k]) for at in swept],
        }
        for k, touch in enumerate(touches)
    ]
    write_json({**asdict(cell), "contender": baseline.name, "contacts": contacts}, file)


Match = tuple[float | None, int | None]
"""Delay [s] of the first alarm a contact caused, and the step of that alarm: (None, None) of a missed contact, (BUSY,
None) where an earlier alarm was still being answered."""


def matched(touches: list[Touching], stamp: FloatArray, onsets: list[int]) -> list[Match]:
    """Match alarms, by the steps at which they begin, with contacts.

    A contact has the first alarm from its onset until some time after its end; both are said by the scenario file.
    """
    judged = scenario("contacts")["judged"]
    at = stamp[onsets]
    found: list[Match] = []
    for touch in touches:
        onset = touch.onset(judged["onset_n"])
        first = int(np.searchsorted(at, onset, side="right"))
        if first > 0 and at[first - 1] > onset - REST * PERIOD_S:
            found.append((BUSY, None))
        elif first < len(at) and at[first] <= touch.end + judged["late_s"]:
            found.append((float(at[first]) - onset, onsets[first]))
        else:
            found.append((None, None))
    return found


def quiet_spread(stream: Stream, until: float) -> FloatArray:
    """Standard deviation (n,) of each joint's external torque [Nm] in the second half of the time until an instant [s].

    That is the free motion of the very arm that is touched afterwards.
    """
    quiet = (stream.stamp >= 0.5 * until) & (stream.stamp < until)
    return np.asarray(stream.robot["tau_ext"][quiet].std(axis=0))


def about(touch: Touching, stream: Stream, noise: FloatArray) -> dict[str, Any]:
    """Say of a contact where and how it was, whether it was seen, and whether its torques stand out of the noise."""
    family = scenario("contacts")
    judged, kinds = family["judged"], family["contact"]["kind"]
    step = max(0, int(np.searchsorted(stream.stamp, touch.onset(judged["onset_n"]), side="right")) - 1)
    kin = model().kinematics(stream.robot["q"][step])
    rotation, origin = kin.rotation[touch.link], kin.position[touch.link]
    radius = float(stream.truth["hand_radius"])
    hand = origin + rotation @ (touch.point + radius * touch.normal)
    away = np.linalg.norm(stream.obstacle_points(step) - hand, axis=1).min(initial=np.inf) - radius
    jacobian = model().jacobian(kin, touch.link, origin + rotation @ touch.point)[:3]
    torque = np.abs(jacobian.T @ (touch.force_n * (rotation @ touch.inwards)))
    name = model().links[touch.link].removeprefix(f"{model().description.name}_")
    return {
        "link": name,
        "kind": kinds[touch.kind]["name"],
        "force_n": touch.force_n,
        "duration_s": touch.duration_s,
        "seen": bool(away <= judged["seen_m"]),
        "detectable": bool(np.any(torque > judged["feelable_sigmas"] * noise)),
    }


def _delay(match: Match) -> float | None:
    return None if match[0] is None else rounded(match[0], 4)


def _towards(match: Match, touch: Touching, stream: Stream, made: Replayed) -> bool | None:
    """Whether the touched point would begin to move against the force on it, towards the person."""
    if match[1] is None:
        return None
    moving = np.flatnonzero(np.isfinite(made.motion[match[1] : match[1] + REST, 0]))
    if not len(moving):
        return False
    step = match[1] + int(moving[0])
    kin = model().kinematics(stream.robot["q"][step])
    rotation = kin.rotation[touch.link]
    there = model().jacobian(kin, touch.link, kin.position[touch.link] + rotation @ touch.point)[:3]
    return bool((rotation @ touch.inwards) @ there @ made.motion[step] < 0.0)
