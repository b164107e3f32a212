"""The page of a recording: the live view with a slider over time."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pretouch.errors import RecordingError
from pretouch.loop import MonotonicClock
from pretouch.recording.reader import Kept, Recorded, Run
from pretouch.recording.surroundings import surroundings
from pretouch.viewer.commands import Commands
from pretouch.viewer.frame import Frame, World
from pretouch.viewer.gui import PERIOD_S, add_button, add_plots, add_view_boxes, dress, put, when_changed
from pretouch.viewer.player import Happening, Happenings, Player
from pretouch.viewer.plots import SPAN_S, History
from pretouch.viewer.scene import Scene
from pretouch.viewer.server import ServeOptions, served, url_of
from pretouch.viewer.status import Status, legend

if TYPE_CHECKING:
    from viser import ViserServer

    from pretouch.recording.compare import Comparison

_LOOKED = 40
"""Steps looked at for happenings between two updates: about 10 ms."""
_STRIDE = 4
"""Of the steps before a place jumped to, each how manieth is drawn."""
_NAMED = 5
"""Contacts named in a sentence."""
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
        stiffness=float("nan"),
    )  # fmt: skip


def frame_of(kept: Kept) -> Frame:
    """What a page draws of a recorded step."""
    truth = kept.truth
    if truth is None:
        return Frame(kept.step, None, None, None)
    hand = truth.hand if np.all(np.isfinite(truth.hand)) else None
    return Frame(kept.step, hand, None, truth.force[-1] if len(truth.force) else None)


def _found_by_other(comparison: "Comparison | None", start: float) -> str:
    """Say which contacts another profile found on the same data, in time since the start [s]."""
    if comparison is None:
        return ""
    times = [f"{found.time - start:.2f} s" for found in comparison.other.contacts]
    shown = ", ".join(times[:_NAMED]) + (f" and {len(times) - _NAMED} more" if len(times) > _NAMED else "")
    return f"On the same data {comparison.other.name} finds " + (f"contacts at {shown}." if times else "no contact.")


class ReplayPage:
    """A page over a recording, turned by `turn`."""

    def __init__(self, server: "ViserServer", recorded: Recorded, comparison: "Comparison | None") -> None:
        self._server, self._recorded, self._comparison = server, recorded, comparison
        self.player = Player(recorded.stamps())
        self._commands = Commands()
        self._happenings = Happenings(lambda i: recorded[i].step, len(recorded))
        self._run, self._drawn = 0, -1
        worlds: dict[int, World] = {0: world_of(recorded.runs[0])}
        self._worlds = worlds
        dress(server)
        self._status = Status(server.gui)
        self._status.notice = " ".join(filter(None, (recorded.said, _found_by_other(comparison, recorded.stamps()[0]))))
        server.gui.add_html(legend())
        self._controls(server)
        self._scene = Scene(server, worlds[0])
        other = comparison.other.name if comparison else ""
        self._history = History(len(worlds[0].skin), 6 if other else 0)
        self._plots = add_plots(server, self._history, worlds[0].skin.ids, other)

    def _controls(self, server: "ViserServer") -> None:
        gui, player, commands = server.gui, self.player, self._commands
        self._slider = gui.add_slider("Time [s]", 0.0, max(player.duration, 0.01), 0.01, 0.0)
        when_changed(self._slider, commands, lambda time: player.seek(float(time)), "seek")
        buttons: tuple[tuple[str, Callable[[], None], str], ...] = (
            ("Step on", lambda: player.step(1), "PLAYER_TRACK_NEXT"),
            ("Step back", lambda: player.step(-1), "PLAYER_TRACK_PREV"),
            ("Next event", lambda: self._jump(self._happenings.after(player.index)), "CHEVRON_RIGHT"),
            ("Previous event", lambda: self._jump(self._happenings.before(player.index)), "CHEVRON_LEFT"),
        )
        self._play = add_button(gui, commands, "Play", player.play, icon="PLAYER_PLAY")
        for label, act, icon in buttons:
            add_button(gui, commands, label, act, icon=icon, color="gray")
        speed = gui.add_dropdown("Speed", ("0.1", "0.25", "0.5", "1", "2", "4"), initial_value="1")
        when_changed(speed, commands, lambda chosen: setattr(player, "speed", float(chosen)), "speed")
        with gui.add_folder("View"):
            add_view_boxes(gui, commands, lambda name, visible: self._scene.show(name, visible))

    def _jump(self, happening: Happening | None) -> None:
        """Pause at a happening."""
        self.player.playing = False
        if happening is None:
            left = "" if self._happenings.done else f" yet: {100 * self._happenings.share:.0f} % has been looked at"
            self._status.notice = f"There is no other contact or change of mode{left}."
            return
        self.player.seek_index(happening.index)
        self._status.notice = f"{happening.what} at {self.player.time:.2f} s"

    def turn(self, now: float, elapsed: float) -> None:
        """Do what people asked for, play on by some real time [s], and draw; `now` is the time of the machine [s]."""
        for action in self._commands.take():
            self._status.notice = ""
            action()
        self.player.advance(elapsed)
        if not self._happenings.done:
            self._happenings.look(_LOOKED)
        if self._server.get_clients():
            self.draw(now)

    def draw(self, now: float) -> Kept:
        """Draw the step at the player's time, and return it."""
        kept = self._come_to(self.player.index)
        with self._server.atomic():
            self._scene.draw(frame_of(kept), now)
            self._plots.draw(now)
            self._show(kept, now)
        return kept

    def _come_to(self, index: int) -> Kept:
        """Take the steps up to one into trail and plots: those since the last, or, after a jump, the last seconds."""
        recorded, follows = self._recorded, 0 <= self._drawn <= index <= self._drawn + 10 * _MOST
        if not follows:
            self._history.clear()
            self._scene.trail.clear()
        start = self._drawn + 1 if follows else max(0, index - int(SPAN_S / self._period()))
        stride = max(1, (index + 1 - start) // _MOST) if follows else _STRIDE
        for i in range(index, start - 1, -stride)[::-1]:
            step = recorded[i].step
            self._history.add(step, self._other(step.stamp))
            self._scene.trail.add(step)
        self._drawn = index
        kept = recorded[index]
        if kept.run != self._run:
            self._run = kept.run
            self._worlds.setdefault(kept.run, world_of(recorded.runs[kept.run]))
            self._scene.show_world(self._worlds[kept.run])
        return kept

    def _period(self) -> float:
        return self._worlds[self._run].profile.task.control_period_s

    def _other(self, stamp: float) -> tuple[float, ...]:
        """Thresholds of the other profile at an instant [s]: upper and lower."""
        if self._comparison is None:
            return ()
        other = self._comparison.other
        at = max(0, int(np.searchsorted(other.time, stamp + 1e-9)) - 1)
        return *other.upper[at].tolist(), *other.lower[at].tolist()

    def _show(self, kept: Kept, now: float) -> None:
        player, step = self.player, kept.step
        if abs(float(self._slider.value) - player.time) > 0.2 or not player.playing:
            put(self._slider, round(player.time, 2))
        self._play.label = "Pause" if player.playing else "Play"
        profile = self._recorded.runs[kept.run].profile.name
        rates = f"{player.time:.2f} of {player.duration:.2f} s · stamp {step.stamp:.2f} s · profile {profile}"
        self._status.draw(step, rates, "", now)


def serve_replay(
    recorded: Recorded,
    options: ServeOptions,
    comparison: "Comparison | None" = None,
    until: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = print,
) -> None:
    """Show a recording as a page until told to stop, with another profile's thresholds if they are given.

    A ViewerError says that the port is taken or the extra is missing, a RecordingError that there is nothing to show.
    """
    if not len(recorded):
        raise RecordingError(f"{recorded.place} holds no control step: there is nothing to show.")
    with served(options, recorded.place.name) as server:
        page = ReplayPage(server, recorded, comparison)
        say(f"The recording is at {url_of(options)} (Ctrl-C ends it).")
        clock = MonotonicClock(PERIOD_S)
        before = clock.tick()
        while not until():
            now = clock.tick()
            page.turn(now, now - before)
            before = now
