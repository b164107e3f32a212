"""What people may change in a live page. Each control puts an action into the queue; the loop does it."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from pretouch.errors import RecordingError
from pretouch.params import PROFILES, Profile, RestrictionMode
from pretouch.types import FloatArray
from pretouch.viewer import palette
from pretouch.viewer.commands import Commands
from pretouch.viewer.gui import add_button, add_view_boxes, put, when_changed
from pretouch.viewer.parameters import TABLE_1, TableEntry, field_docs
from pretouch.viewer.settings import ObjectName, PathName
from pretouch.viewer.simulation import LiveSimulation

if TYPE_CHECKING:
    from viser import GuiApi

RECORDINGS = Path("runs")
"""Folder in which recordings are kept."""


@dataclass
class Running:
    """How time passes."""

    paused: bool = False
    speed: float = 1.0
    """Simulated over real time."""
    single: bool = False
    """One control cycle is to pass, paused or not."""


def named(profile: Profile, base: str) -> Profile:
    """Name a profile by the one it was made from and what is different, as `pretouch.params.profile` reads it."""
    parts = [base]
    for group in fields(Profile):
        mine, theirs = getattr(profile, group.name), getattr(PROFILES[base], group.name)
        if group.name != "name":
            parts += [
                f"{group.name}.{f.name}={_text(getattr(mine, f.name))}"
                for f in fields(mine) if getattr(mine, f.name) != getattr(theirs, f.name)
            ]  # fmt: skip
    return replace(profile, name=":".join(parts))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def fresh_place(folder: Path) -> Path:
    """A file in the folder that is not there yet."""
    number = 1
    while (place := folder / f"live-{number}.mcap").exists():
        number += 1
    return place


class Controls:
    """All controls of a live page, in tabs. Methods without underscore are called by the loop."""

    def __init__(self, gui: "GuiApi", simulation: LiveSimulation, commands: Commands) -> None:
        self._gui, self._simulation, self._commands = gui, simulation, commands
        self.running = Running()
        self._base = simulation.settings.profile.name.partition(":")[0]
        if self._base not in PROFILES:
            self._base = "paper"
        self.on_view: Callable[[str, bool], None] = lambda name, visible: None
        """Told which part of the scene to show or hide."""
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self._run_tab()
        with tabs.add_tab("Controller"):
            self._controller_tab()
        with tabs.add_tab("World"):
            self._world_tab()
        with tabs.add_tab("View"):
            add_view_boxes(gui, commands, lambda name, visible: self.on_view(name, visible))
        self.refresh()

    @property
    def silenced(self) -> frozenset[str]:
        """Ids of the units that were dropped."""
        return self._simulation.settings.faults.silenced

    # tabs

    def _run_tab(self) -> None:
        gui, simulation = self._gui, self._simulation
        self._pause = self._button("Pause", self._toggle_pause, icon="PLAYER_PAUSE")
        self._button("Single step", self._single_step, color="gray", hint="One control cycle; pauses.")
        speed = gui.add_slider("Speed", 0.1, 1.0, 0.1, 1.0, hint="Of the simulated clock; 1 is real time.")
        self._changed(speed, lambda value: setattr(self.running, "speed", float(value)), "speed")
        self._resume = self._button("Resume", simulation.resume, hint="Leave a hold that waits for a person.")
        self._button("Reset", simulation.reset, color="gray", hint="Begin again at time 0 with all as it is set.")
        self._record = self._button("Record", self.toggle_recording, color=palette.AVOIDING)
        with gui.add_folder("Hand"):
            self._hand = [
                gui.add_slider(f"{axis} [m]", low, high, 0.01, 0.0, hint="Or drag the arrows at the hand.")
                for axis, low, high in (("x", -1.0, 1.4), ("y", -1.2, 1.2), ("z", -0.15, 1.4))
            ]
            for slider in self._hand:
                self._changed(slider, lambda _: self._move_hand(), "hand")

    def _controller_tab(self) -> None:
        gui, docs = self._gui, field_docs()
        self._profile = gui.add_dropdown("Profile", tuple(PROFILES), initial_value=self._base)
        self._changed(self._profile, self._choose_profile, "profile")
        self._speed = gui.add_slider("Path speed [m/s]", 0.05, 0.5, 0.05, 0.3, hint=docs["TaskParams", "speed_m_s"])
        self._changed(self._speed, self._choose_speed, "path speed")
        self._mode = gui.add_dropdown(
            "Restrictions", get_args(RestrictionMode), initial_value="slack", hint=docs["RestrictionParams", "mode"]
        )
        self._changed(self._mode, self._choose_restrictions, "restrictions")
        with gui.add_folder("Table I"):
            self._table = []
            for entry in TABLE_1:
                value = entry.read(self._simulation.settings.profile)
                field = gui.add_number(entry.label, value, step=entry.step, hint=entry.hint())
                self._changed(field, partial(self._change_entry, entry), f"parameter {entry.symbol}")
                self._table.append((entry, field))
            self._button("Reset parameters", self._reset_parameters, hint="To those of the profile.")

    def _world_tab(self) -> None:
        gui, simulation = self._gui, self._simulation
        path = gui.add_dropdown("Path", get_args(PathName), initial_value=simulation.settings.path)
        self._changed(path, simulation.set_path, "path")
        thing = gui.add_dropdown(
            "Object", get_args(ObjectName), initial_value=simulation.settings.object, hint="Begins again at time 0."
        )
        self._changed(thing, lambda value: simulation.reset(object=value), "object")
        self._stiffness = gui.add_slider(
            "Stiffness [kN/m]", 3.0, 150.0, 1.0, 75.0, hint="Of hand and object, as soon as nothing touches."
        )
        self._changed(self._stiffness, lambda value: simulation.set_stiffness(1000.0 * value), "stiffness")
        with gui.add_folder("Sensor units"):
            self._units = {unit: gui.add_checkbox(unit, True, hint="Off: is silent.") for unit in simulation.skin.ids}
            self._noise = gui.add_slider("Noise factor", 0.0, 20.0, 0.5, 1.0)
            self._latency = gui.add_slider("More latency [s]", 0.0, 0.5, 0.01, 0.0)
            for handle in (*self._units.values(), self._noise, self._latency):
                self._changed(handle, lambda _: self._set_faults(), "faults")

    def _changed(self, handle: Any, act: Callable[[Any], object], kind: str) -> None:
        when_changed(handle, self._commands, act, kind)

    def _button(self, label: str, act: Callable[[], object], **more: Any) -> Any:
        return add_button(self._gui, self._commands, label, act, **more)

    # what they do

    @property
    def _mine(self) -> Profile:
        return self._simulation.settings.profile

    def _change(self, profile: Profile) -> None:
        self._simulation.set_profile(named(profile, self._base))

    def _change_entry(self, entry: TableEntry, value: float) -> None:
        self._change(entry.write(self._mine, value))

    def _choose_profile(self, base: str) -> None:
        chosen = PROFILES[base]
        profile = replace(chosen, task=replace(chosen.task, speed_m_s=self._mine.task.speed_m_s))
        self._simulation.set_profile(named(profile, base))
        self._base = base

    def _choose_speed(self, speed: float) -> None:
        self._change(replace(self._mine, task=replace(self._mine.task, speed_m_s=float(speed))))

    def _choose_restrictions(self, mode: RestrictionMode) -> None:
        self._change(replace(self._mine, restriction=replace(self._mine.restriction, mode=mode)))

    def _reset_parameters(self) -> None:
        self._choose_profile(self._base)

    def _toggle_pause(self) -> None:
        self.running.paused = not self.running.paused

    def _single_step(self) -> None:
        self.running.paused = self.running.single = True

    def toggle_recording(self) -> None:
        """Begin a recording in a file of its own, or end the one under way."""
        simulation = self._simulation
        if simulation.recording is None:
            try:
                RECORDINGS.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise RecordingError(f"The folder {RECORDINGS} cannot be made: {error.strerror}.") from error
            simulation.start_recording(fresh_place(RECORDINGS))
            simulation.notice = f"Recording to {simulation.recording.place}." if simulation.recording else ""
        else:
            closed = simulation.stop_recording()
            simulation.notice = closed.sentence if closed else ""

    def _move_hand(self) -> None:
        self._simulation.move_hand(np.array([float(slider.value) for slider in self._hand]))

    def _set_faults(self) -> None:
        silenced = frozenset(unit for unit, box in self._units.items() if not box.value)
        self._simulation.set_faults(silenced, float(self._noise.value), float(self._latency.value))

    def refresh(self) -> None:
        """Have all controls show what holds: what was refused goes back."""
        settings, profile = self._simulation.settings, self._mine
        put(self._profile, self._base)
        put(self._speed, profile.task.speed_m_s)
        put(self._mode, profile.restriction.mode)
        for entry, field in self._table:
            put(field, entry.read(profile))
        put(self._stiffness, settings.stiffness / 1000.0)
        for unit, box in self._units.items():
            put(box, unit not in settings.faults.silenced)
        put(self._noise, settings.faults.noise_factor)
        put(self._latency, settings.faults.latency_s)
        self._pause.label = "Go on" if self.running.paused else "Pause"
        self._record.label = "Stop recording" if self._simulation.recording else "Record"

    def offer_resume(self, latched: bool) -> None:
        """Let the button to resume be pressed while a hold waits for it."""
        self._resume.disabled = not latched

    def show_hand(self, target: FloatArray) -> None:
        """Have the sliders show where the hand is to be (3,) [m]."""
        for slider, value in zip(self._hand, target.tolist(), strict=True):
            put(slider, round(value, 2))
