"""The page of a recording: the live view with a slider over time."""

import time
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice

import numpy as np
from viser import GuiApi, ViserServer
from viser._messages import GuiSliderMark  # of the version that pyproject.toml pins

from pretouch.explanation import answers, explain, finds
from pretouch.loop import MonotonicClock
from pretouch.page.frame import DrivenMotion, Frame, World
from pretouch.page.panel import PERIOD_S, ActionQueue, Status, add_button, add_view_boxes, put, style_page, when_changed
from pretouch.page.plots import SPAN_S, History, Plots
from pretouch.page.scene import Scene
from pretouch.recording.reader import Kept, Recorded
from pretouch.recording.run import Run
from pretouch.recording.simulation import surroundings
from pretouch.types import ControlStep, FloatArray, Mode

_SEARCH_S, _SEARCH_PLAYING_S = 0.015, 0.005
"""Time spent on searching for events between two updates, at rest and while it plays [s]."""
_AT_ONCE = 8
_STRIDE = 4
"""Step between drawn steps before a position that is jumped to."""
_MOST = 60
"""Steps drawn in one update: played faster than that, some are left out."""


def world_of(run: Run) -> World:
    """Static world of a recorded run; a page shows nothing that the recording does not contain."""
    room, planes = surroundings(run.about), run.fixtures.planes
    flat = planes[np.all(planes[:, :3] == (0.0, 0.0, 1.0), axis=1)]
    floor = -float(flat[0, 3]) if len(flat) else 0.0
    height = floor if room.floor_height_m is None else room.floor_height_m
    return World(run.model, run.skin, run.path, run.profile, room.boxes, room.hand_radius_m, height)


def frame_of(cycle: Kept) -> Frame:
    """Frame of a page for a recorded step."""
    truth, inputs, age = cycle.truth, cycle.inputs, None
    if inputs is not None and len(inputs.readings.stamp) == len(cycle.step.range_distance):
        age = cycle.step.stamp - inputs.readings.stamp
    if truth is None:
        return Frame(cycle.step, None, None, None, age=age, inputs=inputs)
    hand = truth.hand if np.all(np.isfinite(truth.hand)) else None
    return Frame(cycle.step, hand, None, truth.force[-1] if len(truth.force) else None, age=age, inputs=inputs)


class Player:
    """Position of a page in a recording: plays S steps by their stamps (S,) [s]; S is at least 1."""

    def __init__(self, stamps: FloatArray) -> None:
        self._times = (stamps - stamps[0]).tolist()
        self.duration = self._times[-1]
        """Time from the first step to the last [s]."""
        self.time = 0.0
        """Time since the first step [s]."""
        self.playing = False
        self.speed = 1.0

    @property
    def index(self) -> int:
        """The newest step at this time."""
        return self.index_at(self.time)

    def index_at(self, time: float) -> int:
        """Return the newest step at a time since the first [s], or the first."""
        return max(0, bisect_right(self._times, time + 1e-9) - 1)

    def time_of(self, index: int) -> float:
        """Return the time of a step since the first [s]."""
        return self._times[index]

    def advance(self, elapsed: float) -> None:
        """Advance by real time [s]; it stops at the end."""
        if self.playing:
            self.seek(self.time + self.speed * elapsed)
            self.playing = self.time < self.duration

    def play(self) -> None:
        """Continue or pause; at the end, start again."""
        self.playing = not self.playing
        if self.playing and self.time >= self.duration:
            self.time = 0.0

    def seek(self, time: float) -> None:
        """Go to a time since the first step [s], or the nearest there is."""
        self.time = min(max(time, 0.0), self.duration)

    def seek_index(self, index: int) -> None:
        """Pause, and go to a step, or the nearest there is."""
        self.playing = False
        self.time = self._times[min(max(index, 0), len(self._times) - 1)]


@dataclass(frozen=True)
class TimelineEvent:
    """A contact, or a change of mode, of the recording."""

    index: int
    """The step."""
    what: str


class Timeline:
    """Events of a recording, searched a few steps at a time: of a long one that takes a while."""

    def __init__(self, step: Callable[[int], ControlStep], count: int) -> None:
        """Take what returns a step, and how many there are."""
        self._search, self._count, self._searched = _whats(step, count), count, 0
        self.events: list[TimelineEvent] = []

    @property
    def share(self) -> float:
        """Share of the steps that have been searched."""
        return self._searched / self._count

    def search(self, steps: int) -> None:
        """Search some more steps."""
        for what in islice(self._search, steps):
            if what:
                self.events.append(TimelineEvent(self._searched, what))
            self._searched += 1

    def after(self, index: int) -> TimelineEvent | None:
        """The next one after a step."""
        at = bisect_right(self.events, index, key=lambda event: event.index)
        return self.events[at] if at < len(self.events) else None

    def before(self, index: int) -> TimelineEvent | None:
        """The last one before a step."""
        at = bisect_left(self.events, index, key=lambda event: event.index)
        return self.events[at - 1] if at else None


def _whats(step: Callable[[int], ControlStep], count: int) -> Iterator[str]:
    """Yield the event of each step, or ''."""
    mode, answered = None, True
    for now in map(step, range(count)):
        if now.contact is not None:
            answered = False
            yield f"Contact of {np.linalg.norm(now.contact.force):.1f} N"
        elif mode is not None and now.mode is not mode:
            unmoved = mode is Mode.REACT and not answered
            yield f"{mode.name} to {now.mode.name}{', after a contact that did not move the arm' if unmoved else ''}"
        else:
            yield ""
        mode, answered = now.mode, answered or answers(now)


class ReplayPage:
    """A page over a recording, turned by `turn`."""

    def __init__(self, server: ViserServer, recorded: Recorded) -> None:
        self._server, self._recorded = server, recorded
        stamps = recorded.stamps()
        self.player, self.timeline = Player(stamps), Timeline(recorded.step, len(recorded))
        self._actions = ActionQueue()
        self._run, self._drawn = 0, -1
        self._world = cache(lambda run: world_of(recorded.runs[run]))
        world = self._world(0)
        style_page(server)
        self._status = Status(server.gui)
        self._status.notice = recorded.sentence
        self._add_controls(server.gui)
        self._scene = Scene(server, world)
        self.history = History(stamps[0])
        self._plots = Plots(server.gui, self.history)
        with server.gui.add_folder("View", expand_by_default=False):
            add_view_boxes(server.gui, self._actions, self._scene.show)

    def _add_controls(self, gui: GuiApi) -> None:
        player, timeline, actions = self.player, self.timeline, self._actions
        self._slider = gui.add_slider("Time since the start [s]", 0.0, max(player.duration, 0.01), 0.01, 0.0)
        when_changed(self._slider, actions, lambda time: player.seek(float(time)), "seek")
        self._play = add_button(gui, actions, "Play", player.play, icon="PLAYER_PLAY")
        buttons: dict[str, tuple[str, Callable[[], None]]] = {
            "Step on": ("PLAYER_TRACK_NEXT", lambda: player.seek_index(player.index + 1)),
            "Step back": ("PLAYER_TRACK_PREV", lambda: player.seek_index(player.index - 1)),
            "Next event": ("CHEVRON_RIGHT", lambda: self._jump(timeline.after(player.index))),
            "Previous event": ("CHEVRON_LEFT", lambda: self._jump(timeline.before(player.index))),
        }
        for label, (icon, act) in buttons.items():
            add_button(gui, actions, label, act, icon=icon, color="gray")
        speed = gui.add_dropdown("Speed", ("0.1", "0.25", "0.5", "1", "2", "4"), initial_value="1")
        when_changed(speed, actions, lambda value: setattr(player, "speed", float(value)), "speed")

    def _jump(self, event: TimelineEvent | None) -> None:
        """Pause at an event."""
        self.player.seek_index(self.player.index if event is None else event.index)
        share = self.timeline.share
        left = "" if share == 1.0 else f" so far ({100 * share:.0f} % searched)"
        none = f"No other contact or change of mode was found{left}."
        self._status.notice = none if event is None else f"{event.what} at {self.player.time:.2f} s."

    def hold(self, error: Exception, say: Callable[[str], None]) -> None:
        """Pause after an unexpected error, and show it once."""
        self.player.playing = False
        self._status.fail(error, say)

    def turn(self, now: float, elapsed: float) -> None:
        """Run queued actions, play on by some real time [s], and draw; `now` is the time of the machine [s]."""
        for action in self._actions.take():
            if not action.quiet:
                self._status.notice = ""
            action.run()
        self.player.advance(elapsed)
        end = time.perf_counter() + (_SEARCH_PLAYING_S if self.player.playing else _SEARCH_S)
        while self.timeline.share < 1.0 and time.perf_counter() < end:
            self.timeline.search(_AT_ONCE)
            if self.timeline.share == 1.0:  # a tick for each event
                times = {self.player.time_of(event.index) for event in self.timeline.events}
                # viser takes marks at the slider's creation only, when the events are not found yet
                setattr(self._slider, "_marks", tuple(GuiSliderMark(at, None) for at in sorted(times)))  # noqa: B010
        if self._server.get_clients():
            self.draw(now)

    def draw(self, now: float) -> Kept:
        """Draw the step at the player's time, and return it."""
        cycle = self._advance_history(self.player.index)
        with self._server.atomic():
            motion = self._scene.draw(frame_of(cycle), now)
            self._plots.draw(now)
            self._show(cycle, motion, now)
        return cycle

    def _advance_history(self, index: int) -> Kept:
        """Take the steps up to one into trail and plots: those since the last, or, after a jump, the last seconds."""
        recorded, follows = self._recorded, 0 <= self._drawn <= index <= self._drawn + 10 * _MOST
        if not follows:
            self.history.clear()
            self._scene.trail.clear()
        start = self._drawn + 1 if follows else self.player.index_at(self.player.time - SPAN_S)
        stride = max(1, (index + 1 - start) // _MOST) if follows else _STRIDE
        for i in range(index, start - 1, -stride)[::-1]:
            cycle = recorded[i]
            self.history.add(cycle.step)
            self._scene.trail.add(cycle.step)
        self._drawn = index
        cycle = recorded[index]
        if cycle.run != self._run:
            self._run = cycle.run
            self._scene.show_world(self._world(cycle.run))
        return cycle

    def _show(self, cycle: Kept, motion: DrivenMotion | None, now: float) -> None:
        player, step, world = self.player, cycle.step, self._world(cycle.run)
        if abs(float(self._slider.value) - player.time) > 0.2 or not player.playing:
            put(self._slider, round(player.time, 2))
        self._play.label = "Pause" if player.playing else "Play"
        rates = f"{player.time:.2f} of {player.duration:.2f} s · stamp {step.stamp:.2f} s · {self.run_name(cycle.run)}"
        explanation = explain(step, world.units_in_use, world.model.links, motion.velocities if motion else None)
        self._status.draw(step.mode, explanation, " · ".join(filter(None, (rates, finds(step)))), "", now)

    def run_name(self, run: int) -> str:
        """Return the profile of a run, with the number and path of one of several runs."""
        runs = self._recorded.runs
        part = f", part {run + 1} of {len(runs)}, path of {runs[run].path.length:.2f} m" if len(runs) > 1 else ""
        return f"profile {runs[run].profile.name}{part}"


def show_replay(
    recorded: Recorded,
    server: ViserServer,
    until: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = print,
) -> None:
    """Show a recording on a server's page until told to stop."""
    page = ReplayPage(server, recorded)
    clock = MonotonicClock(PERIOD_S)
    before = clock.tick()
    while not until():
        now = clock.tick()
        try:
            page.turn(now, now - before)
        except Exception as error:  # whatever fails in the page
            page.hold(error, say)
        before = now
