"""The page of a recording: the live view with a slider over time."""

import time
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from pretouch.explanation import finds
from pretouch.loop import MonotonicClock
from pretouch.page.action_queue import ActionQueue
from pretouch.page.asked import Asked, told
from pretouch.page.commander import Commander
from pretouch.page.frame import Frame, World
from pretouch.page.gui import PERIOD_S, add_button, add_view_boxes, put, style_page, when_changed
from pretouch.page.player import Player, Timeline, TimelineEvent
from pretouch.page.plots import SPAN_S, History, Plots
from pretouch.page.scene import Scene
from pretouch.page.server import failure
from pretouch.page.status import Status, legend
from pretouch.recording.reader import Kept, Recorded, Run
from pretouch.recording.simulation import surroundings
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from viser import ViserServer

_SEARCH_S, _SEARCH_PLAYING_S = 0.015, 0.005
"""Time spent on searching for events between two updates, at rest and while it plays [s]."""
_AT_ONCE = 8
_STRIDE = 4
"""Of the steps before a place jumped to, each how manieth is drawn."""
_MOST = 60
"""Steps drawn in one update: played faster than that, some are left out."""


def world_of(run: Run) -> World:
    """What stood still while a run was recorded; of what it does not say, a page shows nothing."""
    known, planes = surroundings(run.about), run.fixtures.planes
    flat = planes[np.all(planes[:, :3] == (0.0, 0.0, 1.0), axis=1)]
    floor = -float(flat[0, 3]) if len(flat) else 0.0
    return World(
        model=run.model, skin=run.skin, path=run.path, profile=run.profile, boxes=known.boxes,
        hand_radius=known.hand_radius,
        floor_height=floor if known.floor_height is None else known.floor_height,
    )  # fmt: skip


def frame_of(kept: Kept) -> Frame:
    """What a page draws of a recorded step."""
    truth, age = kept.truth, _age(kept)
    if truth is None:
        return Frame(kept.step, None, None, None, age=age, inputs=kept.inputs)
    hand = truth.hand if np.all(np.isfinite(truth.hand)) else None
    return Frame(kept.step, hand, None, truth.force[-1] if len(truth.force) else None, age=age, inputs=kept.inputs)


def _age(kept: Kept) -> FloatArray | None:
    """Time since the newest reading of each unit (K,) [s], where the inputs tell."""
    if kept.inputs is None or len(kept.inputs.readings.stamp) != len(kept.step.range_distance):
        return None
    return kept.step.stamp - kept.inputs.readings.stamp


class ReplayPage:
    """A page over a recording, turned by `turn`."""

    def __init__(self, server: "ViserServer", recorded: Recorded) -> None:
        self._server, self._recorded = server, recorded
        stamps = recorded.stamps()
        self.player = Player(stamps)
        self._actions = ActionQueue(Commander(server).admits)
        self.timeline = Timeline(recorded.step, len(recorded))
        self._run, self._drawn = 0, -1
        self._world = cache(lambda run: world_of(recorded.runs[run]))
        world = self._world(0)
        style_page(server)
        self._status = Status(server.gui)
        self._status.notice = recorded.said
        self._controls(server)
        self._scene = Scene(server, world)
        self.history = History(world.skin.first, stamps[0])
        self._plots = Plots(server.gui, self.history, [unit.id for unit in world.skin.mounted])
        with server.gui.add_folder("View", expand_by_default=False):
            add_view_boxes(server.gui, self._actions, self._scene.show)
            server.gui.add_html(legend())

    def _controls(self, server: "ViserServer") -> None:
        gui, player, commands = server.gui, self.player, self._actions
        self._slider = gui.add_slider("Time since the start [s]", 0.0, max(player.duration, 0.01), 0.01, 0.0)
        when_changed(self._slider, commands, lambda chosen: player.seek(float(chosen)), "seek")
        buttons: tuple[tuple[str, Callable[[], None], str], ...] = (
            ("Step on", lambda: player.step(1), "PLAYER_TRACK_NEXT"),
            ("Step back", lambda: player.step(-1), "PLAYER_TRACK_PREV"),
            ("Next event", lambda: self._jump(self.timeline.after(player.index)), "CHEVRON_RIGHT"),
            ("Previous event", lambda: self._jump(self.timeline.before(player.index)), "CHEVRON_LEFT"),
        )
        self._play = add_button(gui, commands, "Play", player.play, icon="PLAYER_PLAY")
        for label, act, icon in buttons:
            add_button(gui, commands, label, act, icon=icon, color="gray")
        speed = gui.add_dropdown("Speed", ("0.1", "0.25", "0.5", "1", "2", "4"), initial_value="1")
        when_changed(speed, commands, lambda chosen: setattr(player, "speed", float(chosen)), "speed")

    def _jump(self, event: TimelineEvent | None) -> None:
        """Pause at an event."""
        self.player.playing = False
        if event is None:
            left = "" if self.timeline.done else f" so far ({100 * self.timeline.share:.0f} % searched)"
            self._status.notice = f"No other contact or change of mode was found{left}."
            return
        self.player.seek_index(event.index)
        self._status.notice = f"{event.what} at {self.player.time:.2f} s."

    def hold(self, error: Exception, say: Callable[[str], None]) -> None:
        """Play no further after an error that nobody foresaw, and say it once."""
        sentence = failure(error)
        self.player.playing = False
        if self._status.notice != sentence:
            self._status.notice = sentence
            say(sentence)

    def turn(self, now: float, elapsed: float) -> None:
        """Run queued actions, play on by some real time [s], and draw; `now` is the time of the machine [s]."""
        for action in self._actions.take():
            if not action.quiet:
                self._status.notice = ""
            action()
        self.player.advance(elapsed)
        self._search_events()
        if self._server.get_clients():
            self.draw(now)

    def _search_events(self) -> None:
        """Search for events, for a time that nobody notices."""
        end = time.perf_counter() + (_SEARCH_PLAYING_S if self.player.playing else _SEARCH_S)
        while not self.timeline.done and time.perf_counter() < end:
            self.timeline.search(_AT_ONCE)

    def draw(self, now: float) -> Kept:
        """Draw the step at the player's time, and return it."""
        kept = self._advance_history(self.player.index)
        with self._server.atomic():
            asked = self._scene.draw(frame_of(kept), now)
            self._plots.draw(now)
            self._show(kept, asked, now)
        return kept

    def _advance_history(self, index: int) -> Kept:
        """Take the steps up to one into trail and plots: those since the last, or, after a jump, the last seconds."""
        recorded, follows = self._recorded, 0 <= self._drawn <= index <= self._drawn + 10 * _MOST
        if not follows:
            self.history.clear()
            self._scene.trail.clear()
        start = self._drawn + 1 if follows else self.player.index_at(self.player.time - SPAN_S)
        stride = max(1, (index + 1 - start) // _MOST) if follows else _STRIDE
        for i in range(index, start - 1, -stride)[::-1]:
            kept = recorded[i]
            step, slow = kept.step, self._world(kept.run).profile.sight.slow_after_s
            self.history.add(step, frame_of(kept).late(slow))
            self._scene.trail.add(step)
        self._drawn = index
        kept = recorded[index]
        if kept.run != self._run:
            self._run = kept.run
            self._scene.show_world(self._world(kept.run))
        return kept

    def _show(self, kept: Kept, asked: Asked | None, now: float) -> None:
        player, step = self.player, kept.step
        if abs(float(self._slider.value) - player.time) > 0.2 or not player.playing:
            put(self._slider, round(player.time, 2))
        self._play.label = "Pause" if player.playing else "Play"
        rates = f"{player.time:.2f} of {player.duration:.2f} s · stamp {step.stamp:.2f} s · {self.run_name(kept.run)}"
        rates = " · ".join(filter(None, (rates, finds(step))))
        world = self._world(kept.run)
        self._status.draw(step.mode, told(asked, step, world.units_in_use, world.model.links), rates, "", now)

    def run_name(self, run: int) -> str:
        """Name the controller of a run; of several, one may differ from another by nothing but its path."""
        runs = self._recorded.runs
        part = f", part {run + 1} of {len(runs)}, path of {runs[run].path.length:.2f} m" if len(runs) > 1 else ""
        return f"profile {runs[run].profile.name}{part}"


def show_replay(
    recorded: Recorded,
    server: "ViserServer",
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
