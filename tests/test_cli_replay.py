"""`pretouch replay`: what is said of a recording, exit codes, and what the page is given."""

import sys
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from pretouch.cli.replay import Replay
from pretouch.controller import Controller
from pretouch.errors import ParameterError, RecordingError
from pretouch.recording.writer import Recording
from tests.following_arm import Arm
from tests.imported_data.files import pushed

PUSHES = ((2.0, 0.6, (0.0, 40.0, 0.0)),)


@pytest.fixture(scope="module")
def whole(panda_model, paper_skin, tmp_path_factory):
    """Five seconds with a push after 2 s, and silent units from 4.5 s on, recorded."""
    arm, place = Arm(panda_model, paper_skin), tmp_path_factory.mktemp("recordings") / "run.mcap"
    with Recording(place, arm.controller, {"command": "pretouch test", "seed": 3}) as recording:
        for sample in pushed(5.0, PUSHES):
            silent = {0: arm.time - 4.5} if arm.time > 4.5 else None
            recording.record(arm.turn(tuple(sample), silent=silent))
    return place


@pytest.fixture
def page(monkeypatch):
    """Take the page's place, and keep what it was given."""
    given = []
    stand_in = SimpleNamespace(show_replay=lambda *args: given.append(args))
    monkeypatch.setitem(sys.modules, "pretouch.page.replay", stand_in)
    return given


@pytest.fixture
def begun(monkeypatch):
    """Begin a page without a server, and keep what was announced."""
    announced = []

    @contextmanager
    def begin(options, title, *_):
        announced.append((options, title))
        yield lambda: "server"

    monkeypatch.setattr("pretouch.cli.replay.begun", begin)
    return announced


def test_a_line_says_what_ran_for_how_long_and_what_happened(capsys, whole, page, begun):
    assert Replay(whole, page=False).run() == 0
    assert begun == page == []
    said = capsys.readouterr().out
    what = "pretouch test: profile paper on panda with 7 units, 5.0 s, 500 steps"
    assert said == f"{what}: 1 contact, 1 hold after the start, held for 24% of the time.\n"


def test_of_a_run_that_was_held_from_the_start_on_it_is_said_that_it_was(capsys, panda_model, paper_skin, tmp_path):
    arm = Arm(panda_model, paper_skin)
    with Recording(tmp_path / "held.mcap", arm.controller) as recording:
        for sample in pushed(1.0, ()):
            recording.record(arm.turn(tuple(sample), silent={0: 9.0}))
    assert Replay(tmp_path / "held.mcap", page=False).run() == 0
    assert "0 contacts, 0 holds after the start, held for 100% of the time." in capsys.readouterr().out


def test_of_a_killed_run_it_is_said_what_is_missing(capsys, whole, tmp_path):
    cut, content = tmp_path / "cut.mcap", whole.read_bytes()
    cut.write_bytes(content[: 2 * len(content) // 3])
    assert Replay(cut, page=False).run() == 0
    said = capsys.readouterr().out.splitlines()
    assert "the end is missing" in said[0]
    assert "every whole part" in said[0]
    assert said[1].startswith("pretouch test: profile paper")


def test_a_recording_that_can_be_recomputed_ends_with_code_0_and_no_page(capsys, whole, page, begun):
    assert Replay(whole, verify=True).run() == 0
    assert "All 500 steps were recomputed and are the same bit for bit." in capsys.readouterr().out
    assert begun == page == []


def test_a_difference_ends_with_code_1(capsys, whole, monkeypatch):
    step = Controller.step

    def otherwise(self, state, inputs):
        made, after = step(self, state, inputs)
        made.speed_scale += 0.25 * (inputs.stamp > 3.0)
        return made, after

    monkeypatch.setattr(Controller, "step", otherwise)
    assert Replay(whole, verify=True, page=False).run() == 1
    said = capsys.readouterr().out
    assert "speed_scale" in said
    assert "steps differ" in said


def test_another_profile_is_shown_beside_the_recorded_one(capsys, whole):
    assert Replay(whole, profile="paper:detect.f_base_n=35", page=False).run() == 0
    said = capsys.readouterr().out
    assert "Contacts: paper as recorded, paper:detect.f_base_n=35 on the same data" in said
    (row,) = [line.split() for line in said.splitlines() if line.strip().startswith("2.1")]
    assert row[2:] == ["y", "-"]
    assert "Detector only: both use the recorded motion of the arm" in said


def test_the_same_profile_is_later_by_nothing(capsys, whole):
    Replay(whole, profile="paper", page=False).run()
    (row,) = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip().startswith("2.1")]
    assert row[0] == row[3]
    assert row[-1] == "+0.00"


def test_the_page_is_given_recording_and_server(whole, page, begun):
    assert Replay(whole, host="127.0.0.1", port=8123).run() == 0
    ((recorded, ours, *_),) = page
    assert (recorded.place, ours) == (whole, "server")
    ((options, title),) = begun
    assert (options.host, options.port, title) == ("127.0.0.1", 8123, "run.mcap")


def test_the_address_is_said_before_the_recording_is_read(whole, page, begun, monkeypatch):
    def read(_place):
        assert len(begun) == 1
        raise RecordingError("read")

    monkeypatch.setattr("pretouch.cli.replay.open_recording", read)
    with pytest.raises(RecordingError, match="read"):
        Replay(whole).run()


def test_an_unknown_profile_is_said_before_the_file_is_read(tmp_path):
    with pytest.raises(ParameterError, match="'brave' is unknown"):
        Replay(tmp_path / "gone.mcap", profile="brave", page=False).run()
