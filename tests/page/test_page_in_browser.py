"""The pages as a person meets them: in a headless Chromium, by mouse and controls."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.page.browser import chromium, serving

from pretouch.arms.simulated.skin import run as simulate
from pretouch.control.path import Circle
from pretouch.explanation import explain
from pretouch.page.live import LivePage, serve_live
from pretouch.page.real_units import RealUnits
from pretouch.page.replay import show_replay
from pretouch.page.room import LiveSettings
from pretouch.page.server import ServeOptions, begun
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import Profile, profile
from pretouch.recording.reader import open_recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import FloatArray, Mode
from pretouch.units.fleet import Fleet, FleetParams
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.skin import NetworkSkin

pytestmark = pytest.mark.slow


def live(simulation: LiveSimulation) -> AbstractContextManager[SimpleNamespace]:
    return serving(lambda options, until, say: serve_live(simulation, options, until, say))


@pytest.fixture
def pages(monkeypatch):
    """The live pages that are served, for their clients' cameras."""
    pages: list[LivePage] = []

    class Registered(LivePage):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            pages.append(self)

    monkeypatch.setattr("pretouch.page.live.LivePage", Registered)
    return pages


def camera(page: LivePage) -> FloatArray:
    """Where the one visitor looks from (3,) [m]."""
    (client,) = page._server.get_clients().values()
    return np.array(client.camera.position)


@pytest.mark.parametrize("touch", [False, True])
def test_a_hand_dragged_into_the_arm_leads_to_a_reaction_and_back_and_the_camera_stays(tmp_path, pages, touch):
    start = np.array([0.85, 0.25, 0.25])
    simulation = LiveSimulation(LiveSettings(profile=profile("blind"), hand_start=tuple(start)))
    with live(simulation) as served, chromium() as visitor:
        visitor.open(served)
        visitor.wait_for("mode", Mode.TRACK.name)
        visitor.wait_for_skin(start)
        before = camera(pages[0])
        at = np.array([0.5, 0.25, 0.25])
        visitor.drag(start, at, touch)
        # the hand is drawn onto the circle in the picture, at the arm's depth where that is near
        visitor.wait_until(lambda: off_line(simulation.hand_target, before, at) < 0.03)
        visitor.wait_until(lambda: off_line(simulation.frame.hand, before, at) < 0.05)
        np.testing.assert_allclose(camera(pages[0]), before, atol=1e-9)
        visitor.press("Reset")  # the hand may have pushed the arm anywhere by now
        visitor.wait_until(lambda: simulation.time < 2.0)
        simulation.move_hand(at)
        visitor.wait_for("mode", Mode.REACT.name)
        visitor.keep(f"reacting-{touch}", tmp_path)
        simulation.move_hand(np.array([1.2, *at[1:]]))
        visitor.wait_for("mode", Mode.TRACK.name)
        # beside hand and arm, which turns the camera
        visitor.drag(np.array([0.3, -0.6, 0.1]), np.array([0.3, -0.4, 0.3]), touch)
        visitor.wait_until(lambda: np.linalg.norm(camera(pages[0]) - before) > 0.1)
        assert simulation.hand_target[0] == 1.2


def off_line(point: FloatArray, eye: FloatArray, through: FloatArray) -> float:
    """Distance of a point (3,) from the line of sight through another [m]."""
    along = (through - eye) / np.linalg.norm(through - eye)
    return float(np.linalg.norm(np.cross(point - eye, along)))


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1024, 768), (1440, 900)])
def test_the_page_shows_word_and_sentence_of_the_step_and_the_panel_covers_no_scene(tmp_path, width, height):
    simulation = LiveSimulation(LiveSettings(profile=profile("paper"), hand_start=(0.5, 0.45, 0.25)))
    with live(simulation) as served, chromium(width, height) as visitor:
        visitor.open(served)
        visitor.wait_for("reason", " sees something at ")  # the hand is beside the path
        visitor.press("Pause")
        visitor.wait_for("rates", "paused")
        explanation = explain(simulation.frame.step, simulation.skin.ids, simulation.model.links)
        visitor.wait_for("reason", explanation.sentence)
        assert visitor.text("word") == explanation.doing.value.upper()
        scene, panel = visitor.box("canvas"), visitor.box("#status")
        assert scene["y"] + scene["height"] <= panel["y"] or scene["x"] + scene["width"] <= panel["x"]
        assert scene["width"] * scene["height"] > 0.5 * width * height
        for label in ("Push the robot's hand", "Go on", "Reset", "Record"):
            button = visitor.page.get_by_role("button", name=label, exact=True).bounding_box()
            assert button["x"] >= 0
            assert button["x"] + button["width"] <= width
            assert button["y"] + button["height"] <= height
        visitor.keep(f"panel-{width}", tmp_path)


def test_one_page_keeps_its_traffic_bounded(tmp_path):
    simulation = LiveSimulation()
    with live(simulation) as served, chromium() as visitor:
        visitor.open(served)
        before, time = visitor.received, simulation.time
        visitor.wait_until(lambda: simulation.time > time + 5.0)
        assert visitor.received - before < 5 * 1_000_000


def test_a_recording_is_played_and_jumped_through(tmp_path):
    simulation = LiveSimulation(LiveSettings(profile=profile("blind")))
    simulation.move_hand(np.array([0.5, 0.0, 0.5]))  # on the circle
    simulation.start_recording(tmp_path / "session.mcap")
    simulation.advance(12.0)
    simulation.stop_recording()
    recorded = open_recording(tmp_path / "session.mcap")
    contacts = [cycle.step for cycle in recorded if cycle.step.contact is not None]
    assert contacts

    def play(options: ServeOptions, until: Callable[[], bool], say: Callable[[str], None]) -> None:
        with begun(options, "test", "The recording", "see it", say) as ready:
            show_replay(recorded, ready(), until, say)

    with serving(play) as served, chromium() as visitor:
        visitor.open(served)
        visitor.wait_for("mode", Mode.HOLD.name)
        visitor.press("Next event")
        visitor.wait_for("notice", "HOLD to TRACK")
        visitor.press("Next event")
        visitor.wait_for("notice", f"Contact of {np.linalg.norm(contacts[0].contact.force):.1f} N")
        visitor.wait_for("mode", Mode.REACT.name)
        visitor.keep("replay", tmp_path)
        visitor.type("Time since the start [s]", 5.0)
        visitor.wait_for("rates", "5.00 of ")
        visitor.press("Step on")
        visitor.wait_for("rates", "5.01 of ")
        visitor.press("Play")
        visitor.wait_for("rates", f"{recorded.stamps()[-1] - recorded.stamps()[0]:.2f} of ")


def test_a_person_drives_the_arm_at_another_by_target(tmp_path, pages):
    simulation = LiveSimulation()
    while simulation.frame.step.mode is not Mode.TRACK:
        simulation.advance(0.1)
    with live(simulation) as served, chromium() as visitor:
        pages[0].controls.paused = True  # however long the browser takes, the arm is driven from one place
        visitor.open(served)
        visitor.choose("Task", "drive yourself")
        visitor.press("Pause")
        visitor.wait_for("reason", "No motion is requested.")
        visitor.wait_until(lambda: float(np.abs(simulation.frame.step.command).max()) < 0.03)
        start = simulation.frame.step.ee_position
        simulation.move_hand(start + np.array([0.0, 0.45, 0.05]))
        # the head of an arrow of the target, with the fingers down: its rings are nearer to the middle
        handle = start - np.array([0.0, 0.195, 0.0])
        visitor.drag(handle, handle + np.array([0.0, 0.6, 0.0]))
        visitor.wait_for("reason", " m/s near panda_hand.")
        visitor.keep("driven", tmp_path)
        goal = pages[0].drive.steering.goal
        assert goal is not None
        assert goal[1, 3] > start[1] + 0.2
        assert np.linalg.norm(goal[[0, 2], 3] - start[[0, 2]]) < 0.05


def test_real_units_on_a_simulated_arm_are_shown_and_missed(tmp_path):
    model, other = RobotModel(panda()), RobotModel(panda())  # each thread its own
    skin = paper_skin(model)
    keys = Keys([UnitKey(unit, k + 1, bytes([k]) * 32) for k, unit in enumerate(skin.ids)])
    over = Event()
    with NetworkSkin(skin.ids, keys) as units:
        fleet = Fleet(skin.network, keys, FleetParams(), 0, units.address)
        path, done = Circle(), lambda _: over.is_set()
        desk = other, paper_skin(other), fleet, path, Profile(), False, done, lambda line: None
        thread = Thread(target=simulate, args=desk)
        thread.start()
        try:
            simulation = LiveSimulation(model=model, skin=skin, real=RealUnits(units))
            with live(simulation) as served, chromium() as visitor:
                visitor.open(served)
                visitor.wait_for("mode", Mode.TRACK.name)
                visitor.keep("desk", tmp_path)
                over.set()
                visitor.wait_for("reason", "No usable reading from hand_left")
                visitor.keep("desk-silent", tmp_path)
        finally:
            over.set()
            thread.join()
            fleet.close()
