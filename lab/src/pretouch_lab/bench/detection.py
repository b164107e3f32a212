"""Contact detectors compared on the same streams: each arm is simulated once, and every detector replays it.

Alarms in free motion are counted. Alarms on touched arms are matched with the contacts that caused them.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch_lab.bench.contacts import Touching, contact_stream
from pretouch_lab.bench.contenders import DETECTORS, Contender, ablated
from pretouch_lab.bench.free import free_stream, warm_up_s
from pretouch_lab.bench.hard import hard_stream
from pretouch_lab.bench.replays import PERIOD_S, REST, Replayed, Steps, alarms_of
from pretouch_lab.bench.scenes import ArmCell, SeedRange, model, numbered, scenario
from pretouch_lab.bench.streams import Stream
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import rounded

FAMILIES = ("free", "contacts", "hard")
ABLATED_ARMS = 2
"""Number of arms in free motion, for each path and bystander, that ablations replay."""
BUSY = -1.0
"""Value in place of a delay: the contact began during the reaction to an earlier alarm."""
Match = tuple[float | None, int | None]
"""Delay [s] and step of the first alarm of a contact: (None, None) for a missed contact, (BUSY, None) for a contact
during the reaction to an earlier alarm."""


def plays(seeds: SeedRange, quick: bool, world: str = "") -> list[Play]:
    """Return the arms to play, long ones first. A `world` leaves out the hard arms, which have their own."""
    hard = [] if world else _hard(seeds, quick)
    arms = [*hard, *_contacts(seeds, quick, world), *_free(seeds, quick, world)]
    return [(asdict(arm), seed) for arm, seed in arms]


def _free(seeds: SeedRange, quick: bool, world: str) -> Iterator[tuple[ArmCell, int]]:
    family, goal, entries = scenario("free"), scenario("contacts")["goal"], Counter[int]()
    counted = family["duration"]["quick_s" if quick else "full_s"]
    for entry, seed in numbered(family, family["arm"], seeds, quick):
        entries[id(entry)] += 1
        usual = entry["kind"] == "nominal" and entry["speed_m_s"] == goal["speed_m_s"]
        ablated = usual and entries[id(entry)] <= ABLATED_ARMS
        where = {name: entry[name] for name in ("kind", "path", "speed_m_s", "near")}
        yield ArmCell("free", **where, sensing="seven", counted_s=counted, ablated=ablated, world=world), seed


def _contacts(seeds: SeedRange, quick: bool, world: str) -> Iterator[tuple[ArmCell, int]]:
    family = scenario("contacts")
    count = family["contact"]["quick" if quick else "full"]
    for entry, seed in numbered(family, family["cell"], seeds, quick):
        kind, sensing, speed = entry["kind"], entry["sensing"], entry["speed_m_s"]
        ablated = (kind, sensing, speed) == ("nominal", "nominal", family["goal"]["speed_m_s"])
        path = "circle" if speed > 0 else "rest"
        yield (
            ArmCell("contacts", kind, sensing, path, speed, "touched", count=count, ablated=ablated, world=world),
            seed,
        )


def _hard(seeds: SeedRange, quick: bool) -> Iterator[tuple[ArmCell, int]]:
    family, size = scenario("hard"), "quick" if quick else "full"
    counted, count = family["duration"][f"{size}_s"], family["contact"][size]
    spent = float(count * (np.mean(family["contact"]["gap_s"]) + np.mean(family["contact"]["durations_s"])))
    entries = [*family["cell"], *({**entry, "near": "touched"} for entry in family["touched"])]
    for entry, seed in numbered(family, entries, seeds, quick):
        touched, arm = entry["near"] == "touched", ArmCell("hard", path=entry["motion"], near=entry["near"])
        yield replace(arm, counted_s=spent if touched else counted, count=count if touched else 0), seed


def trial(cell: Cell, seed: int) -> Row:
    """Simulate an arm, and replay its stream to one detector after the other."""
    arm = ArmCell(**cell)
    stream, touches = streamed(arm, seed)
    steps = Steps(stream, model())

    def judge(contender: Contender) -> Row:
        return judged_contacts(steps, touches, contender) if touches else judged_free(steps, contender)

    contenders = (*DETECTORS, *ablated()) if arm.ablated else DETECTORS
    return {"detectors": [{"contender": one.name, **judge(one)} for one in contenders]}


def rows_of(played: list[Row]) -> list[Row]:
    """Return a row for each arm and detector."""
    ordered = sorted(played, key=lambda row: FAMILIES.index(row["family"]))
    return [{**row, **one} for row in ordered for one in row["detectors"]]


def streamed(arm: ArmCell, seed: int) -> tuple[Stream, list[Touching]]:
    """Simulate an arm; return its stream and its contacts, none in free motion."""
    if arm.family == "free":
        return free_stream(arm, seed), []
    return contact_stream(arm, seed) if arm.family == "contacts" else hard_stream(arm, seed)


def sweep_values(contender: Contender) -> list[float]:
    """Return the values of a contender's swept parameter."""
    return [float(value) for value in scenario("free")["curve"][contender.sweep]]


def judged_free(steps: Steps, contender: Contender) -> Row:
    """Count a detector's alarms after the warm-up, with its own parameter and each value of its sweep."""
    replayed, counted = alarms_of(steps, contender), steps.stream.stamp >= warm_up_s()
    onsets = [replayed.onsets(value) for value in (None, *sweep_values(contender))]
    alarms, *swept = (int(counted[at].sum()) for at in onsets)
    return {"hours": float(counted.sum()) * PERIOD_S / 3600, "alarms": alarms, "sweep": swept}


def judged_contacts(steps: Steps, touches: list[Touching], contender: Contender) -> Row:
    """Match a detector's alarms with contacts, with its own parameter and each value of its sweep."""
    stream, replayed = steps.stream, steps.replay(contender)
    matches = matched(touches, stream.stamp, replayed.onsets())
    swept = [matched(touches, stream.stamp, replayed.onsets(value)) for value in sweep_values(contender)]
    noise = quiet_noise(touches, stream)
    contacts = [
        {
            **about(touch, stream, noise),
            "delay_s": _delay(matches[k]),
            "towards": towards(matches[k], touch, stream, replayed),
            "sweep_s": [_delay(at[k]) for at in swept],
        }
        for k, touch in enumerate(touches)
    ]
    return {"contacts": contacts}


def matched(touches: list[Touching], stamp: FloatArray, onsets: list[int]) -> list[Match]:
    """Match alarms, by the steps of their onsets, with contacts.

    A contact gets the first alarm between its onset and some time after its end, both defined in the scenario file.
    """
    rules = scenario("contacts")["judged"]
    at = stamp[onsets]
    matches: list[Match] = []
    for touch in touches:
        onset = touch.onset(rules["onset_n"])
        first = int(np.searchsorted(at, onset, side="right"))
        if first > 0 and at[first - 1] > onset - REST * PERIOD_S:
            matches.append((BUSY, None))
        elif first < len(at) and at[first] <= touch.end + rules["late_s"]:
            matches.append((float(at[first]) - onset, onsets[first]))
        else:
            matches.append((None, None))
    return matches


def quiet_noise(touches: list[Touching], stream: Stream) -> FloatArray:
    """Return the spread (n,) [Nm] of torques before the first contact, once the arm has moved for a while."""
    quiet = (stream.stamp >= 0.5 * touches[0].start) & (stream.stamp < touches[0].start)
    return np.asarray(stream.robot["tau_ext"][quiet].std(axis=0))


def torques_of(touch: Touching, stream: Stream, step: int) -> FloatArray:
    """Return the joint torques (n,) [Nm] that 1 N of a contact causes in a step."""
    kin = model().kinematics(stream.robot["q"][step])
    rotation, origin = kin.rotation[touch.link], kin.position[touch.link]
    return (rotation @ touch.inwards) @ model().jacobian(kin, touch.link, origin + rotation @ touch.point)[:3]


def about(touch: Touching, stream: Stream, noise: FloatArray) -> dict[str, Any]:
    """Return place, kind and force of a contact, and flags: seen by the skin, torques above the noise."""
    family = scenario("contacts")
    rules, kinds = family["judged"], family["contact"]["kind"]
    step = max(0, int(np.searchsorted(stream.stamp, touch.onset(rules["onset_n"]), side="right")) - 1)
    kin = model().kinematics(stream.robot["q"][step])
    rotation, origin = kin.rotation[touch.link], kin.position[touch.link]
    hand = origin + rotation @ (touch.point + touch.hand_radius * touch.normal)
    away = np.linalg.norm(stream.obstacle_points(step) - hand, axis=1).min(initial=np.inf) - touch.hand_radius
    torque = touch.force_n * np.abs(torques_of(touch, stream, step))
    return {
        "link": model().links[touch.link].removeprefix(f"{model().description.name}_"),
        "kind": kinds[touch.kind]["name"],
        "force_n": touch.force_n,
        "duration_s": touch.duration_s,
        "seen": bool(away <= rules["seen_m"]),
        "detectable": bool(np.any(torque > rules["feelable_sigmas"] * noise)),
    }


def _delay(match: Match) -> float | None:
    return None if match[0] is None else rounded(match[0], 4)


def towards(match: Match, touch: Touching, stream: Stream, replayed: Replayed) -> bool | None:
    """Return True if the touched point would start to move against the force on it; None without an alarm."""
    if match[1] is None:
        return None
    moving = np.flatnonzero(np.isfinite(replayed.motion[match[1] : match[1] + REST, 0]))
    if not len(moving):
        return False
    step = match[1] + int(moving[0])
    return bool(torques_of(touch, stream, step) @ replayed.motion[step] < 0.0)
