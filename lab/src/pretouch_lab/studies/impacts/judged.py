"""What the sequential test makes of one arm's contacts and of its free motion, with the accelerometers and without."""

from collections.abc import Sequence

import numpy as np

from pretouch.profiles import Profile
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.benchmarks.detection.contacts import Touching
from pretouch_lab.benchmarks.detection.replay import begun
from pretouch_lab.benchmarks.localization.judge import place_said, said_of
from pretouch_lab.rows import Row, rounded
from pretouch_lab.studies.impacts.contacts import LOOK, WARM_UP_S, Course, Played, course, plan, play_again
from pretouch_lab.studies.impacts.kinds import GROUPS, KINDS, LINKS

_LATE_S = 0.3
"""How long after its end a contact may still be detected [s]."""
_ONSET_N = 1.0
_GAIN = 2.0
"""Gain from which a step counts as one with a cue [1]."""


def judged(
    found: Profile, seed: int, way: tuple[float, float], free_s: float, kinds: Sequence[str] = KINDS,
    links: Sequence[str] = LINKS,
) -> Row:  # fmt: skip
    """Record one arm touched and one left alone; return what is made of both, with and without the IMUs.

    Args:
        found: profile with the sequential test.
        seed: of the arm and the contacts.
        way: time between a unit's datagrams [s] and vibration of its accelerometer [m/s^2].
        free_s: how long the second arm is left alone [s], warm-up included.
        kinds: of contacts.
        links: each is touched once by each kind.
    """
    touches = plan(seed, kinds, links)
    touched = course(seed, touches, touches[-1].end + 1.0, way)
    alone = course(seed, [], free_s, way)
    counted = alone.stream.stamp >= WARM_UP_S
    contacts: list[Row] = [_about(touch) for touch in touches]
    row: Row = {"hours": rounded(float(counted.sum()) * found.task.control_period_s / 3600, 5)}
    for name, use in (("without", False), ("with", True)):
        made = play_again(touched, found, use)
        onsets = begun(made.alarm)
        for contact, touch in zip(contacts, touches, strict=True):
            contact[name] = _judged(touch, touched, made, _detected(touch, touched.stream.stamp, onsets))
        free = play_again(alone, found, use)
        row[name] = {
            "alarms": int(counted[begun(free.alarm)].sum()),
            "cued": rounded(float((free.gain[counted].max(axis=1) >= _GAIN).mean()), 5),
            "mean_gain": rounded(float(free.gain[counted][:, model().parts].mean()), 4),
        }
    return row | {"contacts": contacts}


def _about(touch: Touching) -> Row:
    link = model().links[touch.link].removeprefix(f"{model().description.name}_")
    group = next(name for name, links in GROUPS.items() if link in links)
    return {
        "kind": KINDS[touch.kind],
        "link": link,
        "group": group,
        "force_n": rounded(touch.force_n, 1),
        "duration_s": rounded(touch.duration_s, 4),
    }


def _detected(touch: Touching, stamp: FloatArray, onsets: list[int]) -> int | None:
    """Return the step of the first alarm that a contact caused, if there is one."""
    return next((i for i in onsets if touch.onset(_ONSET_N) < stamp[i] <= touch.end + _LATE_S), None)


def _judged(touch: Touching, touched: Course, made: Played, step: int | None) -> Row:
    """Say how late a contact was detected, what the cues were, and on which link it was taken to be."""
    parts, stamp = model().parts, touched.stream.stamp
    true = int(np.flatnonzero(parts == touch.link)[0])
    during = (stamp > touch.onset(_ONSET_N)) & (stamp <= touch.onset(_ONSET_N) + 0.1)
    gain = made.gain[during][:, parts]
    jolt = gain[int(gain.max(axis=1).argmax())]
    row: Row = {
        "delay_s": None if step is None else rounded(stamp[step] - touch.onset(_ONSET_N), 4),
        "cued": bool(jolt.max() >= _GAIN),
        "by_imu": bool(jolt.argmax() == true) if jolt.max() >= _GAIN else None,
        "by_imu_near": bool(abs(int(jolt.argmax()) - true) <= 1) if jolt.max() >= _GAIN else None,
    }
    q = touched.stream.robot["q"]
    row["where"] = said_of(touch, stamp, made.touched, q)
    if step is not None:
        later = min(step + LOOK, len(stamp) - 1)
        both = made.links[later] + np.log(made.gain[later][parts])
        row["where_later"] = place_said(touch, made.touched[later], q[later])
        row["by_both"] = bool(both.argmax() == true)
        row["by_both_near"] = bool(abs(int(both.argmax()) - true) <= 1)
    return row
