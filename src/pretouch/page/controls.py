"""Controls of a live page. Each puts an action into the queue; the loop carries it out."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, get_args

import numpy as np
from viser import GuiApi

from pretouch.composition import differences, field_docs
from pretouch.errors import RecordingError
from pretouch.page.panel import SETTLE_S, ActionQueue, add_button, add_view_boxes, put, when_changed
from pretouch.page.room import ObjectName, PathName
from pretouch.page.simulation import LiveSimulation
from pretouch.params import TaskParams
from pretouch.params.pretouch import OFFERED
from pretouch.profiles import Profile, profile, profile_names
from pretouch.sim.tcp_push import AXES

RECORDINGS = Path("runs")
"""Folder in which recordings are kept."""
PUSH_N, PUSH_S = 20.0, 1.0
"""Force [N] and duration [s] of a push unless a person chooses others."""
_NAMES = profile_names()
_TEXT_HINT = "As on the command line, with any parameter: paper:detect.f_base_n=8:approach=none. Enter applies it."
_NO_RESUME = "Resume: nothing waits for it"
_RECORD_SETTLE_S = 0.3
"""Time without another click from which on one on Record counts [s]: each begins a file."""


def with_name(variant: Profile, base: str) -> Profile:
    """Name a profile by the one it was made from and what is different, as `pretouch.profiles.profile` reads it."""
    mine, theirs = (replace(p, name="") for p in (variant, profile(base)))
    return replace(variant, name=":".join([base, *differences(mine, theirs)]))


class Controls:
    """All controls of a live page: few of them shown, the others in folders.

    Methods without underscore are called by the loop.
    """

    def __init__(self, gui: GuiApi, simulation: LiveSimulation, actions: ActionQueue) -> None:
        self._gui, self._simulation, self._actions = gui, simulation, actions
        self.paused = False
        """True while no time passes."""
        self._settings: list[tuple[Any, str, Callable[[], object]]] = []
        """Controls that show a setting, the kind of their action, and what they are to show."""
        self._text: Any = None
        """The field for a profile's text, once it is there."""
        self._written = ""
        """The profile that the field shows, or showed before somebody typed."""
        self._button("Push the robot's hand", self._push, icon="HAND_FINGER", hint="With the force of the folder Push.")
        names = gui.add_dropdown("Profile", _NAMES, hint=OFFERED)
        self._setting(names, self._choose_profile, "profile", lambda: self._base)
        self._pause = self._button("Pause", self._toggle_pause, icon="PLAYER_PAUSE", color="gray")
        hint = "Leave a hold that waits for you."
        self._resume = self._button(_NO_RESUME, simulation.resume, hint=hint, disabled=True)
        self._button("Reset", simulation.reset, color="gray", hint="Restart at time 0 with the current settings.")
        record = partial(toggle_recording, simulation)
        self._record = self._button("Record", record, settle=_RECORD_SETTLE_S, color="gray")
        self.refresh()

    def fold_rest(self, show: Callable[[str, bool], None]) -> None:
        """Add all other controls, each group folded; `show` shows or hides a part of the scene."""
        folders: dict[str, Callable[[], None]] = {
            "Push": self._push_folder,
            "Controller": self._controller_folder,
            "World": self._world_folder,
            "View": lambda: add_view_boxes(self._gui, self._actions, show),
        }
        for name, add in folders.items():
            with self._gui.add_folder(name, expand_by_default=False):
                add()
        self.refresh()

    def _push_folder(self) -> None:
        gui = self._gui
        self._axis = gui.add_dropdown("Direction", tuple(AXES), initial_value="+y", hint="Of the base frame.")
        self._force = gui.add_slider("Force [N]", 5.0, 60.0, 1.0, PUSH_N)
        self._lasting = gui.add_slider("Duration [s]", 0.1, 3.0, 0.1, PUSH_S)

    def _controller_folder(self) -> None:
        gui, hint = self._gui, field_docs(TaskParams)["speed_m_s"]
        speed = gui.add_slider("Path speed [m/s]", 0.05, 0.5, 0.05, 0.3, hint=hint)
        self._setting(speed, self._choose_speed, "path speed", lambda: self._profile.task.speed_m_s, SETTLE_S)
        form = gui.add_form(None)
        with form:
            self._text = gui.add_text("Profile text", "", hint=_TEXT_HINT)
        form.on_submit(self._submit)

    def _world_folder(self) -> None:
        gui, simulation = self._gui, self._simulation
        path = gui.add_dropdown("Path", get_args(PathName))
        self._setting(path, simulation.set_path, "path", lambda: simulation.settings.path)
        thing = gui.add_dropdown("Object", get_args(ObjectName), hint="Restarts at time 0.")
        self._setting(thing, lambda name: simulation.reset(object=name), "object", lambda: simulation.settings.object)
        if not simulation.real:
            with gui.add_folder("Sensor units"):
                self._unit_boxes()

    def _unit_boxes(self) -> None:
        units = [unit.id for unit in self._simulation.skin.mounted]
        self._units = {unit: self._gui.add_checkbox(unit, True, hint="Off: the unit is silent.") for unit in units}
        for unit, box in self._units.items():
            self._setting(box, self._silence, "silence", partial(self._hears, unit))

    def _setting(
        self, handle: Any, act: Callable[[Any], object], kind: str, current: Callable[[], object], settle: float = 0.0
    ) -> None:
        """Have a control act, where it settles when nobody types in it any more; `current` is what it is to show."""
        when_changed(handle, self._actions, act, kind, settle)
        self._settings.append((handle, kind, current))

    def _button(self, label: str, act: Callable[[], object], **more: Any) -> Any:
        return add_button(self._gui, self._actions, label, act, **more)

    # what they do

    @property
    def _profile(self) -> Profile:
        return self._simulation.settings.profile

    @property
    def _base(self) -> str:
        """Name of the profile that the session's was made from."""
        name = self._profile.name.partition(":")[0]
        return name if name in _NAMES else _NAMES[0]

    async def _submit(self, _: Any) -> None:
        text = self._text.value.strip()
        self._actions.put(lambda: self._simulation.set_profile(profile(text)), "profile text")

    def _choose_profile(self, base: str) -> None:
        self._set_speed(profile(base), base, self._profile.task.speed_m_s)

    def _choose_speed(self, speed: float) -> None:
        self._set_speed(self._profile, self._base, float(speed))

    def _set_speed(self, variant: Profile, base: str, speed: float) -> None:
        variant = replace(variant, task=replace(variant.task, speed_m_s=speed))
        self._simulation.set_profile(with_name(variant, base))

    def _hears(self, unit: str) -> bool:
        return unit not in self._simulation.settings.silenced

    def _push(self) -> None:
        """Push the hand as the folder says; the notice tells what became of it."""
        axis = np.array(AXES[self._axis.value])
        self._simulation.push(float(self._force.value) * axis, float(self._lasting.value))

    def _toggle_pause(self) -> None:
        self.paused = not self.paused

    def hold(self) -> None:
        """Let no time pass until somebody goes on."""
        self.paused, self._pause.label = True, "Go on"

    def _silence(self, _: object) -> None:
        self._simulation.silence(frozenset(unit for unit, box in self._units.items() if not box.value))

    def refresh(self) -> None:
        """Have all controls show what holds, but for those that somebody types in: what was refused goes back.

        The text of a profile stays, to be put right: only another profile is written over it, for letters that come
        meanwhile would be lost.
        """
        for handle, kind, current in self._settings:
            if not self._actions.is_waiting(kind):
                put(handle, current())
        changed = self._profile.name != self._written
        if self._text is not None and changed and not self._actions.is_waiting("profile text"):
            self._written = self._profile.name
            put(self._text, self._written)
        self._pause.label = "Go on" if self.paused else "Pause"
        self._record.label = "Stop recording" if self._simulation.recording else "Record"

    def offer_resume(self, possible: bool) -> None:
        """Let the button to resume be pressed while a hold waits for it; else it says that none does."""
        if self._resume.disabled is possible:
            self._resume.disabled, self._resume.label = not possible, "Resume" if possible else _NO_RESUME


def toggle_recording(simulation: LiveSimulation) -> None:
    """Begin a recording in a file of its own, or end the one under way; the simulation's notice says where it is.

    A RecordingError says why none can be begun.
    """
    if simulation.recording is not None:
        simulation.notice = simulation.stop_recording()
        return
    try:
        RECORDINGS.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"The folder {RECORDINGS} cannot be created: {error.strerror}.") from error
    numbered = (RECORDINGS / f"live-{number}.mcap" for number in count(1))
    place = next(place for place in numbered if not place.exists())
    simulation.start_recording(place)
    simulation.notice = f"Recording to {place}."
