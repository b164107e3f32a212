"""Disks that are full, and processes that end while they record."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from pretouch.errors import RecordingError
from pretouch.recording import disk, writer
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.recording.writer import Recording
from tests.recording.runs import Run


def filled(place: Path, controller, cycles: int, room: int) -> tuple[Run, Recording]:
    """Record more than there is room for [B]."""
    run = Run(controller)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        recording = Recording(place, controller)
        for _ in range(cycles):
            recording.record(run.turn())
        recording.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    return run, recording


def test_a_full_disk_leaves_its_whole_chunks_and_a_sentence(controller, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_FLUSH_S", 0.01)  # small chunks, so that many fit
    place = tmp_path / "a.mcap"
    run, recording = filled(place, controller, 600, 300_000)
    assert "File too large" in recording.trouble
    assert str(place) in recording.trouble
    assert recording.close() == recording.trouble
    recorded = open_recording(place)
    assert not recorded.complete
    assert 0 < len(recorded) < len(run.cycles)
    last = float(re.search(r"holds the run up to (\S+) s", recording.trouble)[1])
    assert 0 < last <= recorded.stamps()[-1] + 0.005
    assert verify(recorded).agrees


def test_a_disk_that_is_full_already_is_refused_before_anything_moves(controller, tmp_path):
    with pytest.raises(RecordingError, match=r"a\.mcap cannot be written: File too large: give another name or folder"):
        filled(tmp_path / "a.mcap", controller, 0, 0)
    assert not list(tmp_path.iterdir())


def test_a_disk_without_room_for_anything_is_one_sentence(controller, tmp_path):
    _, recording = filled(tmp_path / "a.mcap", controller, 50, 4096)
    assert "it holds nothing" in recording.trouble
    with pytest.raises(RecordingError, match="no control step"):
        open_recording(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("number", "remedy"),
    [(errno.EIO, "check the disk"), *((full, "free some space") for full in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG))],
)
def test_a_disk_that_fails_is_one_sentence(controller, tmp_path, monkeypatch, number, remedy):
    def fail(writer):
        raise OSError(number, os.strerror(number))

    run = Run(controller)
    recording = Recording(tmp_path / "a.mcap", controller)
    monkeypatch.setattr(disk.Writer, "flush", fail)
    recording.record(run.turn())
    said = recording.close()
    assert os.strerror(number) in said
    assert remedy in said
    recording.record(run.turn())


def test_a_message_that_cannot_be_made_ends_the_recording_and_not_the_run(controller, tmp_path, monkeypatch):
    run = Run(controller)
    recording = Recording(tmp_path / "a.mcap", controller)
    recording.record(run.turn())

    def fail(*given):
        raise ValueError("no")

    monkeypatch.setattr(writer.ViewerTopics, "items", fail)
    recording.record(run.turn())
    assert "ValueError: no" in recording.close()


def test_a_disk_that_does_not_keep_up_is_one_sentence(controller, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_MOST_WAITING", 3)
    held = threading.Event()
    add = disk.Writer.add_message

    def wait(self, *message):
        held.wait()
        add(self, *message)

    monkeypatch.setattr(disk.Writer, "add_message", wait)
    run = Run(controller)
    recording = Recording(tmp_path / "a.mcap", controller)
    for _ in range(20):
        recording.record(run.turn())
    assert "is too slow" in recording.trouble
    held.set()
    assert "is too slow" in recording.close()
    assert 0 < len(open_recording(tmp_path / "a.mcap")) < 20


def test_a_simulation_that_outruns_the_clock_waits_for_the_disk(controller, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_BEHIND", 10)
    monkeypatch.setattr(disk, "_MOST_WAITING", 30)
    run = Run(controller)
    with Recording(tmp_path / "a.mcap", controller) as recording:
        for _ in range(400):
            recording.record(run.turn())
    assert recording.trouble == ""
    assert len(open_recording(tmp_path / "a.mcap")) == 400


PROGRAM = """
import sys, time
from pathlib import Path
from pretouch.recording.writer import Recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from tests.following_arm import controller_of
from tests.recording.runs import Run

place, how = Path(sys.argv[1]), sys.argv[2]
model = RobotModel(panda())
controller = controller_of(model, paper_skin(model))
run = Run(controller)

def go_on(recording):
    begun = time.monotonic()
    while True:
        recording.record(run.turn())
        time.sleep(max(0.0, begun + run.time - time.monotonic()))
        print(run.cycles[-1].step.stamp, flush=True)
        if how == "exit" and run.time > 1.0:
            return

if how == "exit":
    go_on(Recording(place, controller))
else:
    with Recording(place, controller) as recording:
        go_on(recording)
"""


def ended(place: Path, how: str, after: float, number: int | None) -> tuple[float, int, str]:
    """Let a program record, end it by a signal; return the last stamp it told, its exit code and its errors."""
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": f"{root / 'src'}{os.pathsep}{root}"}
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(place), how], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=environment,
    ) as process:  # fmt: skip
        last = 0.0
        for told in process.stdout:
            last = float(told)
            if number is not None and last >= after:
                process.send_signal(number)
                number = None
        errors = process.stderr.read()
    return last, process.returncode, errors


@pytest.mark.slow
def test_a_killed_process_loses_at_most_the_last_second(tmp_path):
    place = tmp_path / "a.mcap"
    last, code, _ = ended(place, "with", 2.5, signal.SIGKILL)
    assert code == -signal.SIGKILL
    recorded = open_recording(place)
    assert not recorded.complete
    assert "the end is missing" in recorded.sentence
    assert recorded.stamps()[-1] >= last - 1.0
    assert verify(recorded).agrees


@pytest.mark.slow
def test_a_program_that_ends_without_closing_leaves_a_whole_file(tmp_path):
    last, code, errors = ended(tmp_path / "a.mcap", "exit", 0.0, None)
    assert (code, errors) == (0, "")
    recorded = open_recording(tmp_path / "a.mcap")
    assert recorded.complete
    assert recorded.stamps()[-1] == last
