"""A push that is held for long: the window's mean follows it, and its release can pass for a push by the other side."""

from itertools import product

import numpy as np

from pretouch.contact.decaying_velocity import DecayingVelocity
from pretouch.control.path import Circle
from pretouch.profiles import profile
from pretouch.sim.plant import TOUCH_N
from pretouch.sim.pushes import FACES, Holder, Push, Pusher, against
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.types import ControlStep, FloatArray, Mode
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, grouped, peak, rounded, spread
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "release"
DEFAULT_RESTRICTIONS = "slack"

HELD_S = (0.3, 1.0, 2.0, 3.0, 4.0)
"""How long each push lasts [s]."""
DECAYS = ("", ":react.decay_cycles=50", ":react.decay_cycles=25")
"""Changes of a profile: as it is (a reaction of 2 s in `paper`), a reaction of 0.5 s, and one of 0.25 s."""

_PUSHES = 3
_FIRST_S = 1.5
_PAUSE_S = 5.5
"""From the end of one push to the reach for the next: the arm is watched, and returns to its path [s]."""
_REACH_S = 1.2
"""About how long the person reaches for the arm [s]."""
_FORCE_N = (15.0, 30.0)
_KEPT_FRACTION = 0.9
"""A push that touches, or is estimated, for less of its time is not counted: it slipped, or met a singularity.
Nor is one whose watch an arm cuts short that is stuck."""
_NOTICE_S = 0.3
"""A reaction up to this long after the release still answers the push [s]."""
WATCHED_S = 3.0
"""A reaction up to this long after the release is the push's echo [s]."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each length of the push and each decay of a reaction that decays, of each profile that senses."""
    controllers = [
        (name, mode) for name, mode in grid.controllers(DEFAULT_RESTRICTIONS) if profile(name).perception is not None
    ]
    return [
        Cell(NAME, name + change, {"held_s": held, "restrictions": mode})
        for held, (name, mode), change in product(HELD_S, controllers, DECAYS)
        if not change or isinstance(profile(name).react, DecayingVelocity)
    ]


def pushes(held_s: float, seed: int) -> tuple[Push, ...]:
    """Three pushes against one face of the robot's hand; the seed decides the face, the directions and the forces."""
    rng = np.random.default_rng([seed, 31])
    face = FACES[rng.integers(len(FACES))]
    planned = []
    for i in range(_PUSHES):
        inwards = against(face, rng)
        planned.append(Push(_FIRST_S + i * (held_s + _PAUSE_S), inwards, rng.uniform(*_FORCE_N), held_s))
    return tuple(planned)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    person = Holder(context.model, pushes(float(cell.where["held_s"]), seed))
    setup = context.setup(cell, seed, SceneSpec(hand=HandSpec()), Circle(), hand=person)
    record = play(setup, lambda step, _: _over(person, step.stamp) or stuck(step))
    row = {
        **cell.row(seed),
        "pushes": judged(record, person),
        "stuck": stuck(record.steps[-1]),
        "held": record.held(),
    }
    return row, record


def _over(person: Pusher, now: float) -> bool:
    """Whether all pushes are done, and the last of them watched."""
    last = max((span[1] for span in person.contacts if span is not None), default=0.0)
    return len(person.contacts) == _PUSHES and now >= last + WATCHED_S


def stuck(step: ControlStep) -> bool:
    """Whether the arm stands where it has no force estimate: it waits there to be guided, and detects no push."""
    return step.mode is Mode.HOLD and not np.isfinite(step.force).all()


def judged(record: Record, person: Pusher) -> list[Row]:
    """Judge each push that touched and was released, up to 3 s after its release or to the touch of the next one."""
    spans = [(push, span) for push, span in zip(person.pushes, person.contacts, strict=False) if span is not None]
    ends = [*(touch for _, (touch, _) in spans), np.inf][1:]
    return [
        _judge(record, push.force, touch, release, min(release + WATCHED_S, end))
        for (push, (touch, release)), end in zip(spans, ends, strict=True)
    ]


def _judge(record: Record, force_n: float, touch: float, release: float, end: float) -> Row:
    """Numbers of one push; `along` is the way it went, and against it is towards the person."""
    pushed = (record.true_time >= touch) & (record.true_time <= release)
    mean = record.true_force[pushed].mean(axis=0)
    along = mean / np.linalg.norm(mean)
    steps = [s for s in record.steps if touch <= s.stamp <= end]
    reactions = [(s.stamp, float(v @ along)) for s, v in record.beginnings() if touch <= s.stamp <= end]
    against = [stamp for stamp, speed in reactions if speed < 0]
    speed = towards(steps, along)
    after = np.array([s.stamp > release for s in steps[1:]])
    opposed = np.array([bool(s.reaction_velocity @ along < 0) for s in steps[1:]])
    return {
        "push_n": rounded(force_n),
        "watched": record.steps[-1].stamp >= end - 1e-9,
        "touching_fraction": rounded(float((np.linalg.norm(record.true_force[pushed], axis=1) > TOUCH_N).mean())),
        "estimated_fraction": rounded(
            float(np.mean([np.isfinite(s.force).all() for s in steps if s.stamp <= release]))
        ),
        "detected": any(speed > 0 and stamp <= release + _NOTICE_S for stamp, speed in reactions),
        "reactions": len(reactions),
        "against_while_held": sum(t <= release for t in against),
        "against_after_release": sum(t > release for t in against),
        "mean_peak_n": rounded(max(abs(float(s.thresholds.mean @ along)) for s in steps)),
        "speed_towards_m_s": rounded(peak(speed[after]), 4),
        "reaction_speed_towards_m_s": rounded(peak(speed[opposed]), 4) if opposed.any() else None,
    }


def towards(steps: list[ControlStep], along: FloatArray) -> FloatArray:
    """Speed (S - 1,) [m/s] of the end-effector against `along` (3,) between S control steps, from its positions.

    The measured velocity would do as well but for its noise, whose peaks would count.
    """
    position = np.array([s.ee_position for s in steps])
    return -(np.diff(position, axis=0) @ along) / np.diff([s.stamp for s in steps])


def summarise(rows: list[Row]) -> Row:
    """Pool the pushes of all trials of a cell."""
    cells = []
    for key, group in grouped(rows, ("held_s", "restrictions", "profile")):
        pooled = _pooled([push for row in group for push in row["pushes"]])
        out = _PUSHES * len(group) - pooled["pushes"]
        cells.append(key | {"trials": len(group), "stuck": sum(row["stuck"] for row in group), "out": out} | pooled)
    return {"cells": cells}


def _pooled(pushed: list[Row]) -> Row:
    """Counts and spreads of the pushes that were held as planned and watched to the end."""
    measures = ("reactions", "mean_peak_n", "speed_towards_m_s", "reaction_speed_towards_m_s")
    done = [
        push
        for push in pushed
        if push["watched"] and min(push["touching_fraction"], push["estimated_fraction"]) >= _KEPT_FRACTION
    ]
    return {
        "pushes": len(done),
        "detected": sum(push["detected"] for push in done),
        "against_while_held": sum(push["against_while_held"] > 0 for push in done),
        "against_after_release": sum(push["against_after_release"] > 0 for push in done),
        **{name: spread([push[name] for push in done if push[name] is not None]) for name in measures},
    }


def _decay_s(name: str) -> float:
    """How long a reaction of a profile lasts [s]."""
    found = profile(name)
    period = found.task.control_period_s
    return DecayingVelocity.of(found.react, period).decay_cycles * period


def _base(name: str) -> str:
    """Return the profile without the change of its decay."""
    return name.split(":react.decay_cycles=")[0]


def tables(part: Row) -> list[TextTable]:
    """How often a release was taken for a push towards the person."""
    several = len({cell["restrictions"] for cell in part["cells"]}) > 1
    columns = (
        ("held\n[s]", plain("held_s", "g")),
        ("profile", lambda cell: _base(cell["profile"]) + (f"\n{cell['restrictions']}" if several else "")),
        ("decay\n[s]", lambda cell: f"{_decay_s(cell['profile']):g}"),
        ("detected", share("detected", "pushes")),
        ("out", plain("out")),
        ("reac-\ntions", median("reactions", 0)),
        ("against\nwhile", plain("against_while_held")),
        ("against\nafter", plain("against_after_release")),
        ("mean\n[N]", median("mean_peak_n", 1)),
        ("back\n[m/s]", median("speed_towards_m_s", 2)),
        ("reacting\n[m/s]", median("reaction_speed_towards_m_s", 2)),
        ("stuck", share("stuck")),
    )
    table = tabulated(
        "A push is held, then released: medians",
        columns,
        part["cells"],
        "Pushes of 15 to 30 N. Decay: length of a reaction. Out: planned pushes that are not counted, for they slipped"
        " off, met a singularity, or an arm that got stuck cut them short; so the rows hold different pushes."
        " Reactions: for each push, until 3 s after its release. Against: pushes with a reaction towards the person,"
        " while it was held and after its release. Mean: the most the window's mean had along the push. Back: fastest"
        " motion towards the person in the 3 s after the release, the way back to the path included. Reacting: the same"
        " in reactions against the push alone. Stuck: trials ended by an arm pushed to where it has no force estimate.",
    )
    return [table]


def _cost(cell: Cell) -> float:
    return _FIRST_S + _PUSHES * float(cell.where["held_s"]) + (_PUSHES - 1) * _PAUSE_S + _REACH_S + WATCHED_S


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables)
