"""The live page: a simulated arm in a browser, and a hand to touch it with."""

from collections.abc import Callable

from viser import ViserServer

from pretouch.errors import PretouchError
from pretouch.explanation import explain, finds, resumable
from pretouch.loop import MonotonicClock
from pretouch.page.companions import Companions
from pretouch.page.controls import Controls
from pretouch.page.drive import Drive
from pretouch.page.panel import PERIOD_S, ActionQueue, Pace, Status, style_page, when_changed
from pretouch.page.plots import History, Plots
from pretouch.page.scene import Scene
from pretouch.page.server import ServeOptions, announce, served
from pretouch.page.simulation import LiveSimulation
from pretouch.types import FloatArray

_ARMS = ("one arm", "three arms")


class LivePage:
    """A page over a simulation, turned by `turn`; people's commands wait in a queue until then.

    `say` gets what whoever serves the page should know too.
    """

    def __init__(
        self, server: ViserServer, simulation: LiveSimulation, say: Callable[[str], None] = lambda line: None
    ) -> None:
        self._server, self._simulation, self._say = server, simulation, say
        self._world, self._time = simulation.world, simulation.time
        self.pace, self.actions = Pace(), ActionQueue()
        self._untouched = simulation.opening is not None
        """True until somebody drags or clicks: the opening, of three arms, repeats while somebody has the page open."""
        self._companions: Companions | None = None
        """Arms beside the page's own; None: it is alone."""
        self._receiver_ended = False
        """True if the receiver of the real units has ended."""
        style_page(server)
        self.status = Status(server.gui)
        if not simulation.real:
            arms = server.gui.add_dropdown("Arms", _ARMS, initial_value=_ARMS[self._untouched], hint="With one hand.")
            when_changed(arms, self.actions, self._show_arms, "arms")
        self.controls = Controls(server.gui, simulation, self.actions)
        self.drive = Drive(server, simulation, self.actions)
        self._scene = Scene(server, simulation.world, on_drag=self._drag)
        if self._untouched:
            self._scene.invite("Drag the hand into the arm's way")
            self._companions = Companions(server, simulation)
        self.status.notice = f"{self._scene.notice} {simulation.notice}".strip()
        simulation.notice = ""
        self._history = History()
        self._plots = Plots(server.gui, self._history)
        self.controls.fold_rest(self._scene.show)

    def _drag(self, eye: FloatArray, place: FloatArray) -> None:
        self.actions.put(lambda: self._simulation.point_hand(eye, place), "hand", quiet=True)

    def _show_arms(self, arms: str) -> None:
        """Begin again with two more arms, or go on with one."""
        if self._companions:
            self._companions.remove()
        self._companions = Companions(self._server, self._simulation) if arms == _ARMS[1] else None
        if self._companions:
            self._simulation.play_opening()

    def hold(self, error: Exception) -> None:
        """Have the arm hold after an error that nobody foresaw, and say it once."""
        self.controls.hold()
        self.status.fail(error, self._say)

    def turn(self, now: float) -> None:
        """Run queued actions, let time pass, and draw; `now` is the time of the machine [s]."""
        simulation = self._simulation
        self._run_actions(now)
        if self._untouched and not self._server.get_clients():
            return
        if self._untouched and not simulation.opening:
            simulation.play_opening()
            self._begin_again()
        recording, before = simulation.recording, simulation.time
        self.drive.turn()
        steps = [] if self.controls.paused else simulation.advance(PERIOD_S)
        for step in steps:
            self._history.add(step)
            self._scene.trail.add(step)
        if self._companions:
            self._companions.follow(len(steps))
        if self.controls.paused:
            self.pace = Pace()
        else:
            self.pace.tick(now, max(0.0, simulation.time - before))
        if recording and recording.trouble:
            self._say(recording.trouble)
        if simulation.real and not self._receiver_ended and not simulation.real.source.alive:
            self._receiver_ended = True
            simulation.notice = "The receiver of the sensor units has ended: start the page again."
            self._say(simulation.notice)
        if simulation.notice:
            self.status.notice, simulation.notice = simulation.notice, ""
            self.controls.refresh()
        if self._server.get_clients():
            self._draw(now)

    def _run_actions(self, now: float) -> None:
        simulation, actions = self._simulation, self.actions.take(now)
        if actions:
            self._untouched = False  # from the first drag or click on, the page is the visitor's
            if simulation.opening:
                simulation.opening.withdraw()
            self._scene.invite("")
        for action in actions:
            if not action.quiet:
                self.status.notice = ""
            try:
                action.run()
            except PretouchError as error:
                self.status.notice = f"Not done: {error}"
        if actions:
            self.controls.refresh()
        if simulation.time < self._time:
            self._begin_again()
        self._time = simulation.time
        if simulation.world is not self._world:
            self._world = simulation.world
            self._scene.show_world(self._world)

    def _begin_again(self) -> None:
        """Forget what was drawn before time 0."""
        if self._companions:
            self._companions.begin()
        self._scene.trail.clear()
        self._history.clear()
        self.drive.steering.goal, self._time = None, self._simulation.time

    def _draw(self, now: float) -> None:
        frame, pace, recording = self._simulation.frame, self.pace, self._simulation.recording
        step, world = frame.step, self._world
        with self._server.atomic():
            motion = self._scene.draw(frame, now)
            self.drive.draw(step)
            if self._companions:
                self._companions.draw(now)
            self._plots.draw(now)
            explanation = explain(step, world.units_in_use, world.model.links, motion.velocities if motion else None)
            paused = "paused" if self.controls.paused else ""
            recorded = f"recording {recording.place.name}" if recording else ""
            line = " · ".join(filter(None, (f"{step.stamp:.0f} s", paused, finds(step), recorded)))
            self.status.draw(step.mode, explanation, line, pace.sentence(), now)
            self.controls.offer_resume(resumable(step))


def serve_live(
    simulation: LiveSimulation,
    options: ServeOptions,
    until: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = print,
) -> None:
    """Show a simulation as a page until told to stop; however it ends, a recording under way is closed.

    A ViewerError says that the port is taken or the extra is missing.
    """
    with served(options, "Pretouch") as server:
        try:
            page = LivePage(server, simulation, say)
            announce(options, "The arm", "move the simulated arm, and record to the disk of this one", say)
            clock, slow = MonotonicClock(PERIOD_S), False
            while not until():
                now = clock.tick()
                try:
                    page.turn(now)
                except Exception as error:  # whatever fails in the page
                    page.hold(error)
                if page.pace.slow is not slow:
                    slow = page.pace.slow
                    say(page.pace.sentence() or "The machine keeps up with real time again.")
        finally:
            if sentence := simulation.stop_recording():
                say(sentence)
