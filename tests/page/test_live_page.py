"""The live page without a browser: what it does between two ticks."""

import asyncio
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.page.browser import seen_at
from tests.page.sessions import set_speed
from tests.page.visitor import control

from pretouch.page.controls import toggle_recording, with_name
from pretouch.page.drive import TASKS
from pretouch.page.live import LivePage
from pretouch.page.panel import PANEL_PX, PERIOD_S, SETTLE_S
from pretouch.page.room import LiveSettings
from pretouch.page.scene import CAMERA_FROM, PARTS
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES, profile
from pretouch.recording.reader import open_recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_for
from pretouch.types import Mode


class Clock:
    """Turns a page at 30 Hz of a time of its own."""

    def __init__(self, page: LivePage) -> None:
        self.page, self.now = page, 0.0

    def turn(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            self.page.turn(self.now)


def give(page: LivePage, label: str, value: object) -> None:
    """Give a control a value as somebody at the page does."""
    handle = control(page, label)
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        asyncio.run(callback(SimpleNamespace(client_id=0, client=None, target=handle)))


def click(page: LivePage, label: str) -> None:
    give(page, label, True)


@pytest.fixture
def clock(page):
    return Clock(page)


def test_a_second_of_ticks_is_a_second_of_the_simulation_but_while_paused(clock, simulation):
    before = simulation.time
    clock.turn(1.0)
    assert simulation.time - before == pytest.approx(1.0, abs=0.011)
    before = simulation.time
    clock.page.controls.paused = True
    clock.turn(1.0)
    assert simulation.time == before


def test_nobody_watching_costs_nothing_but_the_simulation(clock, monkeypatch):
    drawn: list[float] = []
    monkeypatch.setattr(LivePage, "_draw", lambda self, now: drawn.append(now))
    clock.turn(0.5)
    assert drawn == []


def test_a_page_that_is_open_for_long_keeps_no_more_and_more(clock, monkeypatch):
    server = clock.page._server
    monkeypatch.setattr(server, "get_clients", lambda: {0: None})
    messages = server._websock_server._broadcast_buffer.message_from_id
    clock.turn(3.0)
    after_a_while = len(messages)
    clock.turn(3.0)
    assert len(messages) < after_a_while + 0.5 * 3.0 / PERIOD_S


def test_each_recording_gets_a_file_of_its_own_that_is_named(clock, simulation, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        clock.page.actions.put(lambda: toggle_recording(simulation))
        clock.turn(0.3)
        assert clock.page.status.notice == f"Recording to runs/live-{number}.mcap."
        clock.page.actions.put(lambda: toggle_recording(simulation))
        clock.turn(0.1)
        assert f"runs/live-{number}.mcap" in clock.page.status.notice
        assert len(open_recording(Path(f"runs/live-{number}.mcap"))) >= 25


def test_a_folder_for_recordings_that_cannot_be_made_is_said(clock, simulation, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("runs").write_text("in the way")
    clock.page.actions.put(lambda: toggle_recording(simulation))
    clock.turn(0.1)
    assert clock.page.status.notice == "Not done: The folder runs cannot be created: File exists."
    assert simulation.recording is None


def test_a_number_counts_when_nobody_types_any_more(clock, simulation):
    for typed in (0.1, 0.5, 0.2):
        give(clock.page, "Path speed [m/s]", typed)
        clock.turn(0.7)
        assert simulation.world.profile.task.speed_m_s == 0.3
    clock.turn(SETTLE_S)
    assert simulation.world.profile.name == control(clock.page, "Profile text").value == "paper:task.speed_m_s=0.2"


def test_a_changed_profile_is_named_so_that_it_can_be_found_again():
    changed = with_name(profile("paper:detect.f_base_n=8.12345678:task.restore_cycles=150"), "paper")
    assert changed.name == "paper:task.restore_cycles=150:detect.f_base_n=8.12345678"
    assert profile(changed.name) == changed
    assert with_name(PROFILES["blind"], "blind") == PROFILES["blind"]


def test_all_controls_show_what_holds(clock, simulation):
    assert control(clock.page, "Profile text").value == "paper"
    clock.page.actions.put(lambda: simulation.set_profile(profile("pretouch:task.speed_m_s=0.2")))
    clock.page.actions.put(lambda: simulation.set_path("line"))
    clock.page.actions.put(lambda: simulation.reset(object="board -y", silenced=frozenset({"hand_left"})))
    clock.turn(0.1)
    profiles = {"Profile": "pretouch", "Path speed [m/s]": 0.2, "Profile text": "pretouch:task.speed_m_s=0.2"}
    values = {"Path": "line", "Object": "board -y", "hand_left": False, **profiles}
    assert {label: control(clock.page, label).value for label in values} == values


def test_what_was_said_of_the_simulation_before_is_on_the_page_at_first(server, simulation):
    simulation.notice = "The paper's paths for mine: 0.8 times as large."
    clock = Clock(LivePage(server, simulation))
    clock.turn(1.0)
    assert clock.page.status.notice.endswith("for mine: 0.8 times as large.")
    click(clock.page, "Reset")
    clock.turn(1.0)
    assert clock.page.status.notice == ""


def test_what_is_refused_is_said_until_the_next_click_though_the_hand_moves_and_changes_nothing(clock, simulation):
    before = simulation.world.profile
    clock.page.actions.put(lambda: set_speed(simulation, -1.0))
    clock.turn(0.1)
    assert simulation.world.profile == before
    give(clock.page, "Cones", False)
    clock.page._drag(np.array(CAMERA_FROM), np.array([1.0, 0.4, 0.3]))
    clock.turn(0.1)
    assert clock.page.status.notice.startswith("Not done: TaskParams.speed_m_s is -1")
    click(clock.page, "Pause")
    clock.turn(0.1)
    assert clock.page.status.notice == ""


@pytest.mark.parametrize(("width", "height"), [(1024, 768), (1440, 900)])
def test_the_hand_begins_beside_the_panel(simulation, width, height):
    box = {"x": 0, "y": 0, "width": width - PANEL_PX, "height": height}
    assert simulation.frame.hand is not None
    np.testing.assert_allclose(simulation.frame.hand, LiveSettings().hand_start, atol=0.01)
    x, y = seen_at(simulation.frame.hand, box)
    assert 0 < x < width - PANEL_PX
    assert 0 < y < height


def test_a_push_is_felt_or_the_page_says_what_it_lacked(clock, simulation):
    clock.page.actions.put(lambda: simulation.move_hand(np.array([1.4, 0.0, 1.2])))
    clock.turn(1.5)  # the force window is full
    give(clock.page, "Force [N]", 60.0)
    click(clock.page, "Push the robot's hand")
    clock.turn(1.6)
    assert clock.page.status.notice.startswith("The push of 60 N was detected after 0.")
    assert clock.page.status.notice.endswith("and the arm moved with it.")
    assert simulation.frame.step.mode is Mode.REACT
    clock.turn(4.0)
    assert simulation.frame.step.mode is Mode.TRACK
    give(clock.page, "Force [N]", 5.0)
    give(clock.page, "Duration [s]", 0.3)
    click(clock.page, "Push the robot's hand")
    clock.turn(0.8)
    assert clock.page.status.notice.startswith("The push of 5 N was not detected: the filtered force came to ")
    assert clock.page.status.notice.endswith(" N would have been a contact then.")


def test_resuming_is_offered_only_where_a_hold_waits_for_it(clock, monkeypatch):
    monkeypatch.setattr(clock.page._server, "get_clients", lambda: {0: None})
    clock.turn(0.1)
    button = control(clock.page, "Resume: nothing waits for it")
    assert button.disabled
    clock.page.controls.offer_resume(True)
    assert (button.label, button.disabled) == ("Resume", False)


@pytest.mark.slow
def test_three_arms_with_one_hand_go_through_the_same_cycles(server, monkeypatch):
    model = RobotModel(panda())
    simulation = LiveSimulation(LiveSettings(profile=PROFILES["pretouch"]), model, skin_for(model))
    clock = Clock(LivePage(server, simulation))
    monkeypatch.setattr(server, "get_clients", lambda: {0: SimpleNamespace(camera=SimpleNamespace())})
    give(clock.page, "Arms", "three arms")
    clock.turn(8.0)
    beside = clock.page._companions
    assert beside
    assert [arm.name for arm in beside._arms] == ["blind", "paper"]
    for arm in beside._arms:
        assert arm.simulation.time == pytest.approx(simulation.time, abs=1e-9)
        np.testing.assert_array_equal(arm.simulation.frame.hand_target, simulation.frame.hand_target)
    assert beside._arms[0].most > 30.0
    assert 0.0 < beside._most < 0.5 * beside._arms[0].most
    assert beside._arms[0].label.text.endswith(f"touched with {beside._arms[0].most:.0f} N")
    give(clock.page, "Task", TASKS[1])
    clock.page.actions.put(lambda: simulation.set_path("line"))
    clock.page.actions.put(lambda: simulation.silence(frozenset({"hand_left"})))
    clock.turn(0.1)
    assert {arm.simulation.settings.path for arm in beside._arms} == {"line"}
    assert {arm.simulation.settings.silenced for arm in beside._arms} == {simulation.settings.silenced}
    assert {arm.simulation.commander for arm in beside._arms} == {clock.page.drive.steering}
    clock.page.actions.put(simulation.reset)
    clock.turn(0.1)
    assert max(arm.simulation.time for arm in beside._arms) < 1.0
    give(clock.page, "Arms", "one arm")
    clock.turn(0.1)
    assert clock.page._companions is None
    assert not any("blind" in name for name in server.scene._handle_from_node_name)


def test_the_opening_of_three_arms_plays_while_somebody_looks_and_repeats_until_the_first_click(
    server, simulation, monkeypatch
):
    monkeypatch.setattr(LivePage, "_draw", lambda self, now: None)
    simulation.play_opening()
    clock, begun = Clock(LivePage(server, simulation)), simulation.time
    assert control(clock.page, "Arms").value == "three arms"
    assert any(name.endswith("invitation") for name in server.scene._handle_from_node_name)
    clock.turn(1.0)
    assert simulation.time == begun
    visitors = {0: SimpleNamespace(camera=SimpleNamespace())}
    monkeypatch.setattr(server, "get_clients", lambda: visitors)
    clock.turn(3.0)
    assert simulation.time > begun + 2.9
    assert simulation.opening
    simulation.opening = None  # as when the hand is back
    clock.turn(0.1)
    assert simulation.opening
    assert {arm.simulation.time for arm in clock.page._companions._arms} == {simulation.time}
    visitors.clear()
    before = simulation.time
    assert before < begun + 0.2
    clock.turn(0.1)
    assert simulation.time == before
    click(clock.page, "Push the robot's hand")
    clock.turn(3.0)  # in which the hand goes home
    assert simulation.opening is None
    assert not any(name.endswith("invitation") for name in server.scene._handle_from_node_name)


def test_the_tutorial_names_the_controls_there_are_and_no_others():
    root = Path(__file__).parents[2]
    source = "".join(
        (root / f"src/pretouch/page/{name}.py").read_text() for name in ("controls", "drive", "live", "plots")
    )
    labels = set(re.findall(r'(?:add_(?:dropdown|slider|checkbox|text|button)|_button)\(\s*"([^"]+)"', source))
    labels = {label.partition(" [")[0] for label in labels} | {"Resume"}
    folders = set(re.findall(r'"(\w+)": (?:self\._\w+_folder|lambda)', source))
    captions = set(re.findall(r'_caption\("(\w+)', source))
    assert len(labels) > 12
    assert len(folders) == 4
    text = " ".join((root / "docs/tutorial/live.md").read_text().split())
    words = set(re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", text))
    assert words - labels - folders - captions - {part.capitalize() for part in PARTS} == set()
    assert labels - words == set()
    assert {folder for folder in folders if f"- **{folder}**" not in text} == set()
